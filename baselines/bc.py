"""BC: fits the policy's network to the actions of experts, without simulation (paper, II.D)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from baselines import demonstrations, policy, snapshot
from baselines.networks import Stack
from baselines.normalise import CLIP, EPSILON
from baselines.policy import MeanAgent
from baselines.schedule import SCHEDULES, Scheduled
from dextron_bench import Track, Trainer
from dextron_bench.methods.learners import Arrays

BATCH = 512  # Table II.
LEARNING_RATE = 1e-3
HALVED_EVERY = 100  # Epochs.
STEPS = 100  # Updates in an epoch; the paper gives no number.


def imitation_loss(mean: Tensor, actions: Tensor) -> Tensor:
    """Mean squared error (S,) of each agent's actions, tanh(mean), for means and expert actions (S, B, 1)."""
    return (mean.tanh() - actions).square().mean(dim=(1, 2))


@dataclass(frozen=True)
class Bc(Scheduled):
    """Behaviour cloning of the experts (paper, fig. 4a, "BC")."""

    name: ClassVar[str] = "bc"

    @property
    def demonstrated(self) -> int:
        """Expert transitions in each batch: all of them."""
        return BATCH

    def trainer(self, track: Track, seeds: Sequence[int]) -> Trainer:
        """A trainer with one network per seed, all trained together."""
        schedule = SCHEDULES[self.preset]
        return Cloning(demonstrations.load(track, schedule.episodes), seeds, track.device)

    def policy(self, weights: Mapping[str, np.ndarray]) -> MeanAgent:
        """The agent that plays the network's output."""
        return MeanAgent(weights)


class Cloning:
    """The Trainer of BC: fits S networks to demonstrations.

    The networks have the shape of the learners' policies, so each has a second output, which is not used.
    """

    def __init__(self, demos: demonstrations.Demonstrations, seeds: Sequence[int], device: str = "cpu") -> None:
        self.epoch = 0
        self._seeds, self._device = list(seeds), device
        rows = demos.transitions()
        self._mean = demos.states[rows].mean(axis=0, dtype=np.float64)
        self._deviation = np.sqrt(demos.states[rows].var(axis=0, dtype=np.float64) + EPSILON)
        scaled = np.clip((demos.states[rows] - self._mean) / self._deviation, -CLIP, CLIP)
        self._states = torch.tensor(scaled, dtype=torch.float32, device=device)
        self._actions = torch.tensor(demos.actions[rows, None], dtype=torch.float32, device=device)
        self._network = Stack.make(policy.STATE, 2, [np.random.default_rng([seed, 0]) for seed in seeds], device)
        self._optimiser = torch.optim.Adam(self._network.parameters, lr=LEARNING_RATE, fused=True)

    def advance(self) -> list[dict[str, float]]:
        """Trains for one epoch of STEPS updates; returns each seed's mean loss."""
        for group in self._optimiser.param_groups:
            group["lr"] = LEARNING_RATE * 0.5 ** (self.epoch // HALVED_EVERY)
        size = (STEPS, BATCH)
        draws = [np.random.default_rng([s, 1, self.epoch]).integers(len(self._states), size=size) for s in self._seeds]
        rows = torch.tensor(np.stack(draws, axis=1), device=self._device)
        losses = torch.stack([self._update(rows[t]) for t in range(STEPS)]).mean(dim=0)
        self.epoch += 1
        return [{"imitation_loss": loss} for loss in losses.double().tolist()]

    def _update(self, rows: Tensor) -> Tensor:
        """One gradient step of every network on demonstrations `rows` (S, BATCH); returns losses (S,)."""
        mean, _ = policy.head(self._network(self._states[rows]))
        losses = imitation_loss(mean, self._actions[rows])
        self._optimiser.zero_grad(set_to_none=True)
        losses.sum().backward()
        self._optimiser.step()
        return losses.detach()

    def weights(self) -> list[Arrays]:
        """The network's layers, and `mean` and `deviation` of states, for each seed."""
        layers = [parameter.detach().cpu().numpy() for parameter in self._network.parameters]
        scale = {"mean": self._mean, "deviation": self._deviation}
        return [{f"policy.{i}": a[k].copy() for i, a in enumerate(layers)} | scale for k in range(len(self._seeds))]

    def state(self) -> Arrays:
        """Networks, optimiser and epoch."""
        return snapshot.save(self._network.parameters, self._optimiser) | {"epoch": np.array([self.epoch])}

    def journal(self) -> Arrays:
        """Empty: BC gathers no experience, and its demonstrations do not change."""
        return {}

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Continues from another trainer's `state`."""
        snapshot.load(self._network.parameters, self._optimiser, state)
        self.epoch = int(state["epoch"][0])
