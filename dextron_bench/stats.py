"""Scores with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RESAMPLES = 2000
LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean with the ends of its 95 % interval."""

    mean: float
    low: float
    high: float


def estimate(scores: np.ndarray, rng: np.random.Generator) -> Estimate:
    """Mean of scores (seeds, settings) with the percentile interval of a two-level bootstrap.

    Each resample draws seeds with replacement, then settings with replacement, the same for every seed,
    since all seeds play the same settings.
    """
    seeds, settings = scores.shape
    means = np.empty(RESAMPLES)
    for i in range(RESAMPLES):
        by_setting = scores[rng.integers(seeds, size=seeds)].mean(axis=0) if seeds > 1 else scores[0]
        means[i] = by_setting[rng.integers(settings, size=settings)].mean()
    tail = (1.0 - LEVEL) / 2.0
    low, high = np.quantile(means, [tail, 1.0 - tail])
    return Estimate(float(scores.mean()), float(low), float(high))
