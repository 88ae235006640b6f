"""Soft actor-critic, first version, for S agents at once (Haarnoja et al., 2018): one Q, one V, one policy.

The gradient of the policy's loss goes through the action, as the authors of soft actor-critic derive it. The paper's
authors use a likelihood ratio, which has the same expected gradient.

With two critics (two Q), V and the policy learn from the smaller value, as in the later versions of soft actor-critic.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from baselines import policy, snapshot
from baselines.networks import Stack

LEARNING_RATE = 3e-4  # Table II.
POLYAK = 0.01
DISCOUNT = 0.99
BATCH = 32
PENALTY = 1e-3  # Weight of the squares of the policy's mean and logarithm of the deviation.


@dataclass(frozen=True, slots=True)
class Batch:
    """Scaled transitions, float32: states and next states `nexts` (S, B, 48); actions, rewards, alive (S, B, 1).

    `alive` is 0 if the bottle fell, else 1: the value of the next state counts also when the episode was truncated.
    """

    states: Tensor
    actions: Tensor
    rewards: Tensor
    nexts: Tensor
    alive: Tensor


def action_value_target(rewards: Tensor, alive: Tensor, next_value: Tensor, discount: float) -> Tensor:
    """Target of Q, (S, B, 1): the reward, plus the discounted value of the next state if the bottle did not fall."""
    return rewards + discount * alive * next_value


def value_target(action_value: Tensor, log_probability: Tensor) -> Tensor:
    """Target of V, (S, B, 1): Q of the policy's action minus its log density."""
    return action_value - log_probability


def squared_error(prediction: Tensor, target: Tensor) -> Tensor:
    """Mean squared error of each agent, (..., S), of predictions (..., S, B, 1)."""
    return (prediction - target).square().mean(dim=(-2, -1))


def policy_loss(action_value: Tensor, log_probability: Tensor, mean: Tensor, log_std: Tensor) -> Tensor:
    """Loss of each agent's policy, (S,): the negative soft value plus the penalty."""
    penalty = mean.square() + log_std.square()
    return (log_probability - action_value + PENALTY * penalty).mean(dim=(1, 2))


class Sac:
    """Networks, optimiser and updates of S agents."""

    def __init__(self, rngs: Sequence[np.random.Generator], device: str = "cpu", critics: int = 1) -> None:
        """Initialises each agent's networks, with `critics` Q, from its own generator."""
        self._critics = critics
        self.policy = Stack.make(policy.STATE, 2, rngs, device)
        self.action_value = Stack.make(policy.STATE + 1, 1, [*rngs] * critics, device)
        self.value = Stack.make(policy.STATE, 1, rngs, device)
        self.target = self.value.copy()
        self.optimiser = torch.optim.Adam(self.trained_parameters, lr=LEARNING_RATE, fused=True)

    @property
    def trained_parameters(self) -> list[Tensor]:
        """The trained parameters, in a fixed order."""
        return [*self.policy.parameters, *self.action_value.parameters, *self.value.parameters]

    @torch.no_grad()
    def act(self, states: Tensor, noise: Tensor) -> Tensor:
        """Sampled actions (S, B, 1) in scaled states (S, B, 48) for standard normal noise (S, B, 1)."""
        return policy.sample(*policy.head(self.policy(states)), noise)[0]

    def losses(self, batch: Batch, noise: Tensor) -> Tensor:
        """Losses (3, S) of Q, V and policy; the gradient of each loss reaches only its own network."""
        mean, log_std = policy.head(self.policy(batch.states))
        actions, log_probability = policy.sample(mean, log_std, noise)
        sampled = self._action_values(self.action_value.frozen(), batch.states, actions).amin(dim=0)
        with torch.no_grad():
            target = action_value_target(batch.rewards, batch.alive, self.target(batch.nexts), DISCOUNT)
        taken = self._action_values(self.action_value, batch.states, batch.actions)
        return torch.stack([
            squared_error(taken, target).sum(dim=0),
            squared_error(self.value(batch.states), value_target(sampled, log_probability).detach()),
            policy_loss(sampled, log_probability, mean, log_std),
        ])  # fmt: skip

    def _action_values(self, networks: Stack, states: Tensor, actions: Tensor) -> Tensor:
        """Values (critics, S, B, 1) of actions (S, B, 1) in states (S, B, 48)."""
        inputs = torch.cat([states, actions], dim=-1)
        return networks(inputs.repeat(self._critics, 1, 1)).unflatten(0, (self._critics, len(inputs)))

    def update(self, batch: Batch, noise: Tensor) -> Tensor:
        """One gradient step of every network and agent; returns the losses (3, S)."""
        losses = self.losses(batch, noise)
        self.optimiser.zero_grad(set_to_none=True)
        losses.sum().backward()
        self.optimiser.step()
        self.target.average_with(self.value, POLYAK)
        return losses.detach()

    def save(self) -> dict[str, np.ndarray]:
        """Copies of all parameters and of the optimiser's state, by name."""
        return snapshot.save([*self.trained_parameters, *self.target.parameters], self.optimiser)

    def load(self, saved: Mapping[str, np.ndarray]) -> None:
        """Restores the arrays that `save` returned."""
        snapshot.load([*self.trained_parameters, *self.target.parameters], self.optimiser, saved)
