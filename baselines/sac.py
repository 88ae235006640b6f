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
from baselines.backprop import Joined
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


def policy_loss(action_value: Tensor, log_probability: Tensor, mean: Tensor, log_std: Tensor) -> Tensor:
    """Loss of each agent's policy, (S,): the negative soft value plus the penalty."""
    penalty = mean.square() + log_std.square()
    return (log_probability - action_value + PENALTY * penalty).mean(dim=(1, 2))


class Sac:
    """Networks, optimiser and updates of S agents.

    The networks of a kind are one part of a joined stack: the policies, then V, then each agent's Q, one critic after
    the other. Q has the action as a further input, which is 0 for the others.
    """

    def __init__(self, rngs: Sequence[np.random.Generator], device: str = "cpu", critics: int = 1) -> None:
        """Initialises each agent's networks, with `critics` Q, from its own generator."""
        agents = len(rngs)
        self._critics = critics
        self._policy, self._value = slice(0, agents), slice(agents, 2 * agents)
        self._action_value = slice(2 * agents, None)
        policies = Stack.make(policy.STATE, 2, rngs, device)
        action_values = Stack.make(policy.STATE + 1, 1, [*rngs] * critics, device)
        values = Stack.make(policy.STATE, 1, rngs, device)
        self.networks, self._target = Joined([policies, values, action_values]), Joined([values])
        self.networks.values.grad = self.networks.gradients
        self._optimiser = torch.optim.Adam([self.networks.values], lr=LEARNING_RATE, fused=True)

    @property
    def policy(self) -> list[Tensor]:
        """Views of the policies' parameters, as in `Stack`."""
        return self.networks.parameters(self._policy, policy.STATE, 2)

    @property
    def value(self) -> list[Tensor]:
        """Views of the parameters of V."""
        return self.networks.parameters(self._value, policy.STATE, 1)

    @property
    def action_value(self) -> list[Tensor]:
        """Views of the parameters of Q, (critics x S, ...)."""
        return self.networks.parameters(self._action_value, policy.STATE + 1, 1)

    @property
    def target(self) -> list[Tensor]:
        """Views of the parameters of the target of V."""
        return self._target.parameters()

    @torch.no_grad()
    def act(self, states: Tensor, noise: Tensor) -> Tensor:
        """Sampled actions (S, B, 1) in scaled states (S, B, 48) for standard normal noise (S, B, 1)."""
        outputs = self.networks.forward(_with_zeros(states), self._policy).outputs
        return policy.sample(*policy.head(outputs), noise)[0]

    @torch.no_grad()
    def update(self, batch: Batch, noise: Tensor) -> Tensor:
        """One gradient step of every network and agent; returns the losses (3, S) of Q, V and policy."""
        losses = self.differentiate(batch, noise)
        self._optimiser.step()
        for target, parameter in zip(self.target, self.value, strict=True):
            target.lerp_(parameter, POLYAK)
        return losses

    @torch.no_grad()
    def differentiate(self, batch: Batch, noise: Tensor) -> Tensor:
        """Sets the gradients; returns the losses (3, S) of Q, V and policy. Each loss has only its own network."""
        still, taken = _with_zeros(batch.states), torch.cat([batch.states, batch.actions], dim=-1)
        played = self.networks.forward(torch.cat([still, still, *([taken] * self._critics)]))
        mean, log_std = policy.head(played.outputs[self._policy])
        actions, log_probability = policy.sample(mean, log_std, noise)
        smallest, value_slope = self._smallest_value(batch.states, actions)
        next_value = self._target.forward(batch.nexts).outputs
        target = action_value_target(batch.rewards, batch.alive, next_value, DISCOUNT)
        q_error = played.outputs[self._action_value, :, :1] - target.repeat(self._critics, 1, 1)
        v_error = played.outputs[self._value, :, :1] - value_target(smallest, log_probability)
        slope = torch.zeros_like(played.outputs)
        slope[self._action_value, :, :1], slope[self._value, :, :1] = 2.0 * q_error, 2.0 * v_error
        slope[self._policy] = policy_slope(value_slope, played.outputs[self._policy], actions, noise)
        self.networks.backward(played, slope / batch.states.shape[1])
        q_losses = q_error.square().mean(dim=(-2, -1)).unflatten(0, (self._critics, -1)).sum(dim=0)
        v_losses = v_error.square().mean(dim=(-2, -1))
        return torch.stack([q_losses, v_losses, policy_loss(smallest, log_probability, mean, log_std)])

    def _smallest_value(self, states: Tensor, actions: Tensor) -> tuple[Tensor, Tensor]:
        """The smallest Q (S, B, 1) of actions (S, B, 1) in states (S, B, 48), and its slope in the action."""
        inputs = torch.cat([states, actions], dim=-1).repeat(self._critics, 1, 1)
        done = self.networks.forward(inputs, self._action_value)
        values = done.outputs[..., :1].unflatten(0, (self._critics, -1))
        smallest = values.amin(dim=0)
        chosen = torch.zeros_like(done.outputs)
        chosen[..., :1] = (values == smallest).flatten(0, 1)
        slope = self.networks.input_slope(done, chosen, self._action_value, policy.STATE)
        return smallest, slope.unflatten(0, (self._critics, -1)).sum(dim=0)

    def save(self) -> dict[str, np.ndarray]:
        """Copies of all parameters and of the optimiser's state, by name."""
        return snapshot.save([self.networks.values, self._target.values], self._optimiser)

    def load(self, saved: Mapping[str, np.ndarray]) -> None:
        """Restores the arrays that `save` returned."""
        snapshot.load([self.networks.values, self._target.values], self._optimiser, saved)


def policy_slope(value_slope: Tensor, outputs: Tensor, actions: Tensor, noise: Tensor) -> Tensor:
    """Slope (S, B, 2) of the policy's loss in its outputs (S, B, 2), times B; takes the slope of Q in the actions.

    For an action tanh(u), the logarithm of the slope of tanh adds 2 tanh(u) to the slope in u.
    """
    mean, log_std = policy.head(outputs)
    raw_slope = 2.0 * actions - value_slope * (1.0 - actions.square())
    std_slope = raw_slope * log_std.exp() * noise - 1.0 + 2.0 * PENALTY * log_std
    unclamped = outputs[..., 1:] == log_std
    return torch.cat([raw_slope + 2.0 * PENALTY * mean, std_slope * unclamped], dim=-1)


def _with_zeros(states: Tensor) -> Tensor:
    """States (S, B, 48) with a further input of 0."""
    return torch.nn.functional.pad(states, (0, 1))
