"""Scores of one method with their uncertainty (docs/statistics.md). The module `paired` compares two methods.

Scores are arrays of shape (seeds, settings): every seed of every method plays the same settings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import trim_mean

RESAMPLES = 2000
LEVEL = 0.95
TAIL = (1.0 - LEVEL) / 2.0
TRIMMED = 0.25  # Share of the cells that the interquartile mean drops at each end.


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean and the ends of its 95 % interval."""

    mean: float
    low: float
    high: float


def estimate(scores: np.ndarray, rng: np.random.Generator, settings: np.ndarray | None = None) -> Estimate:
    """Mean of scores (seeds, settings) with the percentile interval of a two-level bootstrap.

    Each resample draws settings with replacement, the same for every seed, and then seeds with replacement. `settings`
    (RESAMPLES, settings) counts the draws of each setting; without it they are drawn here.
    """
    if settings is None:
        settings = draw_counts(scores.shape[1], rng)
    return interval(float(scores.mean()), resampled_means(scores, settings, rng))


def draw_counts(size: int, rng: np.random.Generator) -> np.ndarray:
    """How often each of `size` items is drawn in each resample of `size` draws: whole numbers (RESAMPLES, size)."""
    indices = rng.integers(size, size=(RESAMPLES, size))
    indices += size * np.arange(RESAMPLES)[:, None]
    return np.bincount(indices.ravel(), minlength=indices.size).reshape(indices.shape).astype(float)


def resampled_means(scores: np.ndarray, settings: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Mean of scores (seeds, settings) in each resample, shape (RESAMPLES,).

    `settings` (RESAMPLES, settings) counts the draws of each setting; two methods with equal counts are paired. Seeds
    are drawn here. Sums of whole scores are exact, so a resample is the same on every machine.
    """
    return (draw_counts(len(scores), rng) * (settings @ scores.T)).sum(axis=1) / scores.size


def interval(mean: float, resamples: np.ndarray) -> Estimate:
    """A mean with the percentile interval of its resamples (RESAMPLES,)."""
    low, high = np.quantile(resamples, [TAIL, 1.0 - TAIL])
    return Estimate(mean, float(low), float(high))


def interquartile_mean(scores: np.ndarray, strata: np.ndarray, rng: np.random.Generator) -> Estimate:
    """Mean of the middle half of the cells with its interval; a cell is the mean score of one seed in one stratum.

    `scores` has the shape (seeds, settings), `strata` (settings,) holds labels. All strata have the same weight,
    however many settings they have. Each resample draws settings with replacement within each stratum, and then seeds.
    """
    cells = []
    for stratum in np.unique(strata):
        stratum_scores = scores[:, strata == stratum]
        cells.append(draw_counts(stratum_scores.shape[1], rng) @ stratum_scores.T / stratum_scores.shape[1])
    seeds = rng.integers(len(scores), size=(RESAMPLES, len(scores)))
    resamples = np.take_along_axis(np.stack(cells, axis=2), seeds[:, :, None], axis=1)
    means = [scores[:, strata == stratum].mean(axis=1) for stratum in np.unique(strata)]
    return interval(
        float(trim_mean(np.ravel(means), TRIMMED)), trim_mean(resamples.reshape(RESAMPLES, -1), TRIMMED, axis=1)
    )
