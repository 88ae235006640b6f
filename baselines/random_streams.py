"""The random numbers of a training: each kind has a stream of its own in every seed, so that no kind shifts another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

NETWORKS, EPISODES, DEMONSTRATIONS, ACTING, WARM_START, BATCHES, NOISE, HOLDING = range(8)
PAIRS = 9


def generator(seed: int, *stream: int) -> np.random.Generator:
    """The generator of a stream of a seed, or of a part of it, such as one epoch."""
    return np.random.default_rng([seed, *stream])


@dataclass(frozen=True, slots=True)
class Draws:
    """The numbers of one epoch, for each of its frames and each seed."""

    seeds: Sequence[int]
    epoch: int
    frames: int

    def uniform(self, stream: int, width: int) -> np.ndarray:
        """Uniform numbers (frames, S, width) in [0, 1)."""
        draws = [generator(seed, stream, self.epoch).random((self.frames, width)) for seed in self.seeds]
        return np.stack(draws, axis=1)

    def normal(self, stream: int, width: int) -> np.ndarray:
        """Standard normal numbers (frames, S, width)."""
        draws = [generator(seed, stream, self.epoch).standard_normal((self.frames, width)) for seed in self.seeds]
        return np.stack(draws, axis=1)
