"""Scores of one method with their uncertainty (docs/statistics.md); two methods are compared in `paired`.

Scores are arrays (seeds, settings): every seed of every method plays the same settings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import trim_mean

RESAMPLES = 2000
LEVEL = 0.95
TAIL = (1.0 - LEVEL) / 2.0
TRIMMED = 0.25  # Share that the interquartile mean leaves out at either end.


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with the ends of its 95 % interval."""

    mean: float
    low: float
    high: float


def estimate(scores: np.ndarray, rng: np.random.Generator) -> Estimate:
    """Mean of scores (seeds, settings) with the percentile interval of a two-level bootstrap.

    Each resample draws seeds with replacement, then settings with replacement, the same for every seed,
    since all seeds play the same settings.
    """
    return interval(float(scores.mean()), resampled(scores, drawn(scores.shape[1], rng), rng))


def drawn(things: int, rng: np.random.Generator) -> np.ndarray:
    """How often each of some things is drawn in a resample as large as they are, (RESAMPLES, things), whole numbers."""
    chosen = rng.integers(things, size=(RESAMPLES, things))
    chosen += things * np.arange(RESAMPLES)[:, None]
    return np.bincount(chosen.ravel(), minlength=chosen.size).reshape(chosen.shape).astype(float)


def resampled(scores: np.ndarray, settings: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Mean of scores (seeds, settings) in each resample, (RESAMPLES,).

    Settings count as often as `settings` (RESAMPLES, settings) says: methods that are given the same ones are paired.
    Seeds are drawn here. Sums of whole scores are exact, so that a resample is the same on any machine.
    """
    return (drawn(len(scores), rng) * (settings @ scores.T)).sum(axis=1) / scores.size


def interval(mean: float, resamples: np.ndarray) -> Estimate:
    """A value with the percentile interval of its resamples (RESAMPLES,)."""
    low, high = np.quantile(resamples, [TAIL, 1.0 - TAIL])
    return Estimate(mean, float(low), float(high))


def interquartile_mean(scores: np.ndarray, strata: np.ndarray, rng: np.random.Generator) -> Estimate:
    """Mean of the middle half of the cells, a cell being the mean score of a seed in a stratum; with its interval.

    `scores` is (seeds, settings), `strata` (settings,) labels; strata weigh the same, however many settings they have.
    Each resample draws seeds with replacement, then settings with replacement within each stratum.
    """
    cells = []
    for stratum in np.unique(strata):
        own = scores[:, strata == stratum]
        cells.append(drawn(own.shape[1], rng) @ own.T / own.shape[1])
    seeds = rng.integers(len(scores), size=(RESAMPLES, len(scores)))
    again = np.take_along_axis(np.stack(cells, axis=2), seeds[:, :, None], axis=1)
    means = [scores[:, strata == stratum].mean(axis=1) for stratum in np.unique(strata)]
    return interval(
        float(trim_mean(np.ravel(means), TRIMMED)), trim_mean(again.reshape(RESAMPLES, -1), TRIMMED, axis=1)
    )
