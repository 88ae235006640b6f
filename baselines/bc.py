"""BC: fits the policy's network to the actions of experts, without simulation (paper, II.D)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
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
from dextron_bench import Trainer, TrainingSetup
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

    def trainer(self, setup: TrainingSetup, seeds: Sequence[int]) -> Trainer:
        """A trainer with one network per seed, all trained together."""
        schedule = SCHEDULES[self.preset]
        return Cloning(demonstrations.load(setup, schedule.episodes), seeds, setup.device)

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
        self._states = self._scaled(demos.states[rows])
        self._actions = torch.tensor(demos.actions[rows, None], dtype=torch.float32, device=device)
        self._network = Stack.make(policy.STATE, 2, [np.random.default_rng([seed, 0]) for seed in seeds], device)
        self._optimiser = torch.optim.Adam(self._network.parameters, lr=LEARNING_RATE, fused=True)

    def advance(self) -> list[dict[str, float]]:
        """Trains for one epoch of STEPS updates; returns each seed's mean loss."""
        for group in self._optimiser.param_groups:
            group["lr"] = LEARNING_RATE * 0.5 ** (self.epoch // HALVED_EVERY)
        losses = torch.stack([self._update(*batch) for batch in self._batches()]).mean(dim=0)
        self.epoch += 1
        return [{"imitation_loss": loss} for loss in losses.double().tolist()]

    def _batches(self) -> Iterator[tuple[Tensor, Tensor]]:
        """The STEPS batches of an epoch: scaled states (S, BATCH, 48) and the experts' actions (S, BATCH, 1)."""
        for rows in self._drawn(1, len(self._states), BATCH):
            yield self._states[rows], self._actions[rows]

    def _drawn(self, stream: int, count: int, size: int) -> Tensor:
        """Numbers (STEPS, S, size) below `count`, from one stream of each seed."""
        streams = [np.random.default_rng([seed, stream, self.epoch]) for seed in self._seeds]
        draws = [rng.integers(count, size=(STEPS, size)) for rng in streams]
        return torch.tensor(np.stack(draws, axis=1), device=self._device)

    def _scaled(self, states: np.ndarray) -> Tensor:
        """Scaled states (..., 48)."""
        scaled = np.clip((states - self._mean) / self._deviation, -CLIP, CLIP)
        return torch.tensor(scaled, dtype=torch.float32, device=self._device)

    def _update(self, states: Tensor, actions: Tensor) -> Tensor:
        """One gradient step of every network on states (S, B, 48) and actions (S, B, 1); returns losses (S,)."""
        mean, _ = policy.head(self._network(states))
        losses = imitation_loss(mean, actions)
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
