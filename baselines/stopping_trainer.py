"""Trains the networks of STOPPING: maximises the chance of success of closing at one of many decisions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, logsigmoid, pad

from baselines import pose_features, snapshot
from baselines.networks import Stack
from baselines.normalise import CLIP, EPSILON
from dextron_bench.experts.openings import NO_DECISION, OpeningSteps
from dextron_bench.methods.learners import Arrays

MEMBERS = 5  # Networks of an agent, whose outputs are averaged.
HIDDEN = 48
DROPOUT = 0.1  # Share of the hidden units that an episode of a batch goes without.
EPOCHS, UPDATES = 30, 100  # Number of epochs, and of updates in each.
BATCH = 96  # Episodes.
LEARNING_RATE, WEIGHT_DECAY = 3e-3, 0.03
RISING = 0.3  # Share of the updates in which the learning rate rises.
IMITATION = 0.3  # Weight of the cross-entropy of "closing now succeeds", which the second output predicts.
EDGE, STEEPNESS = 0.065, 200.0  # [m], [1/m] of the ramp in the distance with which a training begins.
NEVER = -30.0  # The logit of closing where there is no decision.


class Decisions:
    """The decisions of N openings, padded to D: scaled features (N, D, F); distance, outcome, validity, each (N, D)."""

    def __init__(self, openings: Sequence[OpeningSteps], device: str) -> None:
        """Takes openings; `mean` and `deviation` (F,) scale the features."""
        episodes = [self._of(*opening) for opening in openings]
        seen = np.concatenate([features for features, _ in episodes])
        self.mean, self.deviation = seen.mean(axis=0), np.sqrt(seen.var(axis=0) + EPSILON)
        shape = len(episodes), max(len(outcomes) for _, outcomes in episodes)
        scaled = np.zeros((*shape, pose_features.COUNT), np.float32)
        distance, outcome, valid = np.ones(shape, np.float32), *np.zeros((2, *shape), np.float32)
        for k, (features, outcomes) in enumerate(episodes):
            n = len(outcomes)
            scaled[k, :n] = np.clip((features - self.mean) / self.deviation, -CLIP, CLIP)
            distance[k, :n], outcome[k, :n], valid[k, :n] = features[:, pose_features.DISTANCE], outcomes, 1.0
        arrays = scaled, distance, outcome, valid
        self._scaled, self._distance, self._outcome, self._valid = (torch.tensor(a, device=device) for a in arrays)

    def __len__(self) -> int:
        return len(self._scaled)

    def rows(self, numbers: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Features, distances, outcomes and validity of openings (n, B)."""
        return self._scaled[numbers], self._distance[numbers], self._outcome[numbers], self._valid[numbers]

    @staticmethod
    def _of(states: np.ndarray, outcomes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Features (d, F) and outcomes (d,) of an opening's decisions."""
        decided = outcomes != NO_DECISION
        return pose_features.of_episode(states.astype(float))[decided], outcomes[decided]


def expected_success(logits: Tensor, outcomes: Tensor) -> Tensor:
    """Chance of success (...) if the hand closes with probability sigmoid(logit) at each decision until it has closed.

    `logits` and `outcomes` have the shape (..., D); an outcome is 1 if closing there succeeds, else 0.
    """
    open_until = pad(logsigmoid(-logits).cumsum(dim=-1)[..., :-1], (1, 0))  # Logarithm of the probability.
    return ((logsigmoid(logits) + open_until).exp() * outcomes).sum(dim=-1)


def learning_rate(progress: float) -> float:
    """The learning rate after a share of all updates: rises from a 25th, then falls to 0, along cosines."""
    if progress < RISING:
        return LEARNING_RATE * (0.52 - 0.48 * np.cos(np.pi * progress / RISING))
    return LEARNING_RATE * (0.5 + 0.5 * np.cos(np.pi * (progress - RISING) / (1.0 - RISING)))


class StoppingTrainer:
    """The Trainer of STOPPING: MEMBERS networks for each seed, all trained together."""

    def __init__(self, decisions: Decisions, seeds: Sequence[int], device: str = "cpu") -> None:
        self.epoch = 0
        self._decisions, self._seeds, self._device = decisions, list(seeds), device
        rngs = [np.random.default_rng([seed, 0, member]) for seed in seeds for member in range(MEMBERS)]
        self._networks = Stack.make(pose_features.COUNT, 2, rngs, device, HIDDEN)
        self._ramp = torch.tensor([EDGE, STEEPNESS], device=device).repeat(len(rngs), 1, 1, 1).requires_grad_()
        self._parameters = [*self._networks.parameters, self._ramp]
        groups = [{"params": self._networks.parameters}, {"params": [self._ramp], "weight_decay": 0.0}]
        self._optimiser = torch.optim.AdamW(groups, weight_decay=WEIGHT_DECAY)

    def advance(self) -> list[dict[str, float]]:
        """Trains for one epoch of UPDATES updates; returns each seed's mean loss."""
        rngs = [np.random.default_rng([seed, 1, m, self.epoch]) for seed in self._seeds for m in range(MEMBERS)]
        drawn = np.stack([rng.integers(len(self._decisions), size=(UPDATES, BATCH)) for rng in rngs], axis=1)
        kept = np.stack([rng.random((UPDATES, 2, BATCH, 1, HIDDEN)) >= DROPOUT for rng in rngs], axis=1)
        rows, masks = (torch.tensor(array, device=self._device) for array in (drawn, kept))
        losses = [self._update(rows[t], masks[t], self.epoch * UPDATES + t) for t in range(UPDATES)]
        self.epoch += 1
        by_seed = torch.stack(losses).mean(dim=0).double().view(-1, MEMBERS).mean(dim=1)
        return [{"stopping_loss": loss} for loss in by_seed.tolist()]

    def _update(self, rows: Tensor, kept: Tensor, number: int) -> Tensor:
        """One gradient step of every network on openings (n, BATCH), without the units that are not kept."""
        for group in self._optimiser.param_groups:
            group["lr"] = learning_rate(number / (EPOCHS * UPDATES))
        scaled, distance, outcome, valid = self._decisions.rows(rows)
        closing, succeeds = self._outputs(scaled, distance, kept)
        success = expected_success(torch.where(valid > 0, closing, NEVER), outcome).mean(dim=1)
        entropy = binary_cross_entropy_with_logits(succeeds, outcome, reduction="none") * valid
        losses = IMITATION * entropy.sum(dim=(1, 2)) / valid.sum(dim=(1, 2)) - success
        self._optimiser.zero_grad(set_to_none=True)
        losses.sum().backward()
        self._optimiser.step()
        return losses.detach()

    def _outputs(self, scaled: Tensor, distance: Tensor, kept: Tensor) -> tuple[Tensor, Tensor]:
        """The logits (n, B, D) of closing, and of success if the hand closes now."""
        n, size, decisions, _ = scaled.shape
        w1, b1, w2, b2, w3, b3 = self._networks.parameters
        hidden = torch.baddbmm(b1, scaled.flatten(1, 2), w1).relu()
        for layer, (weight, bias) in enumerate([(w2, b2), (w3, b3)]):
            masked = hidden.view(n, size, decisions, -1) * (kept[:, layer] / (1.0 - DROPOUT))
            hidden = torch.baddbmm(bias, masked.flatten(1, 2), weight)
            hidden = hidden.relu() if layer == 0 else hidden
        outputs = hidden.view(n, size, decisions, 2)
        edge, steepness = self._ramp.unbind(dim=-1)
        return outputs[..., 0] + steepness * (edge - distance), outputs[..., 1]

    def weights(self) -> list[Arrays]:
        """The layers and the ramp of each seed's networks, and `mean` and `deviation` of the features."""
        arrays = {f"network.{i}": layer for i, layer in enumerate(self._networks.parameters)}
        arrays["ramp"] = self._ramp.flatten(1)
        scale = {"mean": self._decisions.mean, "deviation": self._decisions.deviation}
        members = [slice(k * MEMBERS, (k + 1) * MEMBERS) for k in range(len(self._seeds))]
        return [{name: a[k].detach().cpu().numpy().copy() for name, a in arrays.items()} | scale for k in members]

    def state(self) -> Arrays:
        """Networks, optimiser and epoch."""
        return snapshot.save(self._parameters, self._optimiser) | {"epoch": np.array([self.epoch])}

    def journal(self) -> Arrays:
        """Empty: the openings do not change."""
        return {}

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Continues from another trainer's `state`."""
        snapshot.load(self._parameters, self._optimiser, state)
        self.epoch = int(state["epoch"][0])
