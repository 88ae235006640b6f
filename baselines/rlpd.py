"""RLPD: SAC with half of each batch from demonstrations, and an ensemble of normalised Q (Ball et al., ICML 2023).

The target of all Q is the smaller value of a random pair of them; the policy climbs their mean. The temperature is
learned, so that the policy keeps an entropy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import layer_norm

from baselines import demonstrations, policy, snapshot
from baselines.cycle import Cycle
from baselines.demonstrations import Everything
from baselines.networks import HIDDEN, Stack
from baselines.policy import STATE, MeanAgent
from baselines.random_streams import BATCHES, NOISE, PAIRS, Draws
from baselines.sac import DISCOUNT, LEARNING_RATE, Batch, action_value_target
from baselines.schedule import SCHEDULES, Scheduled
from dextron_bench import Trainer, TrainingSetup
from dextron_bench.errors import BadInput

WARM_START = 1000  # Frames with random actions, before the first update.
POLYAK = 0.005
ENTROPY = -0.5  # Of the policy, which the temperature keeps: minus half of the number of actions.


@dataclass(frozen=True)
class Rlpd(Scheduled):
    """SAC that learns from demonstrations and its own episodes in equal parts, with an ensemble of Q."""

    name: ClassVar[str] = "rlpd"

    critics: int = 5
    """Number of Q, 2 or more; the authors have 10."""
    updates: int = 1
    """Updates of the Q at each frame; the policy has one. The authors have 20."""
    batch: int = 64
    """Transitions in a batch, an even number; half of them are demonstrations. The authors have 256."""

    def __post_init__(self) -> None:
        if self.critics < 2 or self.updates < 1 or self.batch < 2 or self.batch % 2:
            flags = f"--critics {self.critics} --updates {self.updates} --batch {self.batch}"
            raise BadInput(f"{flags}: give 2 critics or more, 1 update or more, and an even batch")

    @property
    def stem(self) -> str:
        """The name with the settings that are not the defaults, such as "rlpd-10c-20u"."""
        parts = ((name[0], getattr(self, name), getattr(Rlpd, name)) for name in ("critics", "updates", "batch"))
        return self.name + "".join(f"-{value}{letter}" for letter, value, default in parts if value != default)

    @property
    def demonstrated(self) -> int:
        """Expert transitions in each batch: half of them."""
        return self.batch // 2

    def trainer(self, setup: TrainingSetup, seeds: Sequence[int]) -> Trainer:
        """A trainer with one agent per seed, all trained together."""
        schedule = replace(SCHEDULES[self.preset], warm_start=WARM_START)
        experts = Everything.of(demonstrations.load(setup, schedule.episodes))
        return Cycle(setup, seeds, schedule, partial(SeveralUpdates, method=self), experts, self.demonstrated)

    def policy(self, weights: Mapping[str, np.ndarray]) -> MeanAgent:
        """The agent that plays the policy's mean."""
        return MeanAgent(weights)


class SeveralUpdates:
    """The Algorithm of RLPD: several updates of an ensemble of Q at each frame, and one of the policy."""

    losses = "action_value_loss", "policy_loss", "temperature"
    scales_rewards = False  # The learned temperature fits any scale.

    def __init__(self, rngs: Sequence[np.random.Generator], device: str, method: Rlpd) -> None:
        self.networks, self._device, self._method = Ensemble(rngs, device, method.critics), device, method

    def draw(self, draws: Draws) -> tuple[Any, ...]:
        """Numbers that select transitions (FRAMES, S, G B), noises (FRAMES, S, (G + 1) B, 1), and orders of the Q."""
        updates, batch, critics = self._method.updates, self._method.batch, self._method.critics
        selecting = draws.uniform(BATCHES, updates * batch)
        noise = draws.normal(NOISE, (updates + 1) * batch)[..., None]
        orders = draws.uniform(PAIRS, updates * critics).reshape(*selecting.shape[:2], updates, critics)
        return selecting, torch.tensor(noise, dtype=torch.float32, device=self._device), orders.argsort(axis=-1)

    def update(self, batch: Callable[[np.ndarray], Batch], drawn: Sequence[Any]) -> Tensor:
        """Returns the losses (3, S)."""
        uniform, noise, orders = drawn
        *noises, last = noise.split(self._method.batch, dim=1)
        batches = [batch(part) for part in np.split(uniform, self._method.updates, axis=1)]
        parts = zip(batches, noises, orders[..., :2].swapaxes(0, 1), strict=True)
        losses = [self.networks.update_values(*part) for part in parts]
        return torch.cat([torch.stack(losses).mean(dim=0)[None], self.networks.update_policy(batches[-1].states, last)])


def action_values(parameters: Sequence[Tensor], states: Tensor, actions: Tensor) -> Tensor:
    """Q (n, B, 1) of n perceptrons, whose hidden layers are normalised before their ReLU.

    The normalisation follows the bias, and has no scale and no shift.
    """
    w1, b1, w2, b2, w3, b3 = parameters
    hidden = layer_norm(torch.baddbmm(b1, torch.cat([states, actions], dim=-1), w1), (HIDDEN,)).relu()
    hidden = layer_norm(torch.baddbmm(b2, hidden, w2), (HIDDEN,)).relu()
    return torch.baddbmm(b3, hidden, w3)


class Ensemble:
    """Policy, temperature, and E layer-normalised Q of S agents; number e S + s of a stack is Q e of agent s."""

    def __init__(self, rngs: Sequence[np.random.Generator], device: str, critics: int) -> None:
        self._agents, self._critics = len(rngs), critics
        self._policy = Stack.make(STATE, 2, rngs, device)
        self.policy = self._policy.parameters
        self.values = Stack.make(STATE + 1, 1, [*rngs] * critics, device).parameters
        self.targets = [parameter.detach().clone() for parameter in self.values]
        self.log_temperature = torch.zeros(self._agents, 1, 1, device=device, requires_grad=True)
        parts = self.policy, self.values, [self.log_temperature]
        self._parts = [(part, torch.optim.Adam(part, lr=LEARNING_RATE)) for part in parts]

    @torch.no_grad()
    def act(self, states: Tensor, noise: Tensor) -> Tensor:
        """Sampled actions (S, B, 1) in scaled states (S, B, 48) for standard normal noise (S, B, 1)."""
        return policy.sample(*policy.head(self._policy(states)), noise)[0]

    def update_values(self, batch: Batch, noise: Tensor, pair: np.ndarray) -> Tensor:
        """One gradient step of every Q; `pair` (S, 2) are the Q of each agent's target. Returns the losses (S,)."""
        wanted = self.value_target(batch, noise, pair).repeat(self._critics, 1, 1)
        states, actions = (part.repeat(self._critics, 1, 1) for part in (batch.states, batch.actions))
        losses = (action_values(self.values, states, actions) - wanted).square().mean(dim=(1, 2))
        self._step(1, losses.sum())
        for target, parameter in zip(self.targets, self.values, strict=True):
            target.lerp_(parameter.detach(), POLYAK)
        return losses.detach().view(self._critics, -1).mean(dim=0)

    @torch.no_grad()
    def value_target(self, batch: Batch, noise: Tensor, pair: np.ndarray) -> Tensor:
        """Target of Q (S, B, 1): the smaller value of a pair of target Q, less the entropy's price."""
        actions, log_probability = policy.sample(*policy.head(self._policy(batch.nexts)), noise)
        rows = torch.as_tensor(pair.T * self._agents + np.arange(self._agents), device=actions.device).flatten()
        chosen = [parameter[rows] for parameter in self.targets]
        values = action_values(chosen, batch.nexts.repeat(2, 1, 1), actions.repeat(2, 1, 1))
        smaller = values.unflatten(0, (2, -1)).amin(dim=0)
        soft = smaller - self.log_temperature.exp() * log_probability
        return action_value_target(batch.rewards, batch.alive, soft, DISCOUNT)

    def update_policy(self, states: Tensor, noise: Tensor) -> Tensor:
        """One gradient step of every policy and temperature; returns policy losses and temperatures (2, S)."""
        actions, log_probability = policy.sample(*policy.head(self._policy(states)), noise)
        values = action_values(self.values, *(part.repeat(self._critics, 1, 1) for part in (states, actions)))
        mean_value, temperature = values.unflatten(0, (self._critics, -1)).mean(dim=0), self.log_temperature.exp()
        losses = (temperature.detach() * log_probability - mean_value).mean(dim=(1, 2))
        self._step(0, losses.sum())
        self._step(2, -(temperature * (log_probability.detach() + ENTROPY)).mean(dim=(1, 2)).sum())
        return torch.stack([losses.detach(), temperature.detach().flatten()])

    def _step(self, number: int, loss: Tensor) -> None:
        """One step of an optimiser along the slope of a loss in its own parameters."""
        parameters, optimiser = self._parts[number]
        for parameter, slope in zip(parameters, torch.autograd.grad(loss, parameters), strict=True):
            parameter.grad = slope
        optimiser.step()

    def save(self) -> dict[str, np.ndarray]:
        """Copies of all parameters and of the optimisers' states, by name."""
        saved = {f"target.{i}": target.cpu().numpy().copy() for i, target in enumerate(self.targets)}
        for number, part in enumerate(self._parts):
            saved |= {f"part.{number}.{name}": array for name, array in snapshot.save(*part).items()}
        return saved

    def load(self, saved: Mapping[str, np.ndarray]) -> None:
        """Restores the arrays that `save` returned."""
        for i, target in enumerate(self.targets):
            target.copy_(torch.tensor(saved[f"target.{i}"]))
        for number, part in enumerate(self._parts):
            start = f"part.{number}."
            snapshot.load(*part, {name.removeprefix(start): a for name, a in saved.items() if name.startswith(start)})
