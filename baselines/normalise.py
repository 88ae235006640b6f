"""Running means and variances that scale states and rewards."""

from __future__ import annotations

import numpy as np

CLIP = 10.0  # Scaled states and rewards are clipped to [-CLIP, CLIP].
EPSILON = 1e-8
PRIOR = 1e-4  # Weight of the initial mean 0 and variance 1, as a number of observations.


class Moments:
    """Mean and variance of a stream of vectors, with one stream for each of S agents."""

    def __init__(self, agents: int, size: int) -> None:
        self.count = np.full((agents, 1), PRIOR)
        self.mean = np.zeros((agents, size))
        self.variance = np.ones((agents, size))

    def update(self, values: np.ndarray) -> None:
        """Adds one vector per agent, (S, size), to the streams."""
        delta = values - self.mean
        self.mean += delta / (self.count + 1.0)
        self.variance += (delta * (values - self.mean) - self.variance) / (self.count + 1.0)
        self.count += 1.0

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviations (S, size), never 0."""
        return np.sqrt(self.variance + EPSILON)
