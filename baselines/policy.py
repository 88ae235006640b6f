"""The policy of the paper's learners: a Gaussian followed by tanh; and the agent that plays its mean."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from torch import Tensor
from torch.nn.functional import softplus

from baselines.normalise import CLIP
from dextron_bench import Perceptron
from dextron_bench.methods.exact import rounded

STATE = 48
LOG_STD = (-20.0, 2.0)


def head(outputs: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and logarithm of the standard deviation, each (S, B, 1), from a policy network's outputs (S, B, 2)."""
    mean, log_std = outputs.split(1, dim=-1)
    return mean, log_std.clamp(*LOG_STD)


def sample(mean: Tensor, log_std: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """Actions in (-1, 1) and their log densities, for standard normal noise; all (S, B, 1)."""
    raw = mean + log_std.exp() * noise
    return raw.tanh(), log_probability(raw, log_std, noise)


def log_probability(raw: Tensor, log_std: Tensor, noise: Tensor) -> Tensor:
    """Log density of tanh(raw), if raw lies `noise` standard deviations from its mean.

    Uses log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2 u)), which stays exact when tanh(u) rounds to 1.
    """
    gaussian = -0.5 * noise.square() - log_std - 0.5 * math.log(2.0 * math.pi)
    return gaussian - 2.0 * (math.log(2.0) - raw - softplus(-2.0 * raw))


class MeanAgent:
    """Plays tanh(mean), the deterministic policy of one seed's weights; the actions do not depend on the batch size."""

    rows_are_independent = True

    def __init__(self, weights: Mapping[str, np.ndarray]) -> None:
        """Takes `mean` and `deviation` (48,) of states, and the policy's layers as `policy.0`, `policy.1`, ..."""
        self._mean, self._deviation = (np.asarray(weights[name], np.float64) for name in ("mean", "deviation"))
        layers = [weights[f"policy.{i}"] for i in range(6)]
        self._network = Perceptron(list(zip(layers[::2], layers[1::2], strict=True)))

    def reset(self, episodes: np.ndarray) -> None:
        """Does nothing: the agent has no memory."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Closing speeds (N, 1) for states (N, 48)."""
        scaled = np.clip((states - self._mean) / self._deviation, -CLIP, CLIP)
        return rounded(np.tanh(self._network(scaled)[:, :1]))
