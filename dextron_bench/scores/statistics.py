"""Scores of one method with their uncertainty (docs/statistics.md). The module `paired` compares two methods.

Scores are arrays of shape (seeds, settings): every seed of every method plays the same settings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtrit
from scipy.stats import trim_mean

from dextron_bench.world import task

Bounds = tuple[float, float]  # The smallest and the largest possible value.
RETURNS: Bounds = (0.0, task.SUCCESS)
SHARES: Bounds = (0.0, 1.0)
RESAMPLES = 2000
LEVEL = 0.95
TRIMMED = 0.25  # Share of the cells that the interquartile mean drops at each end.
SMALLEST = 1e-30  # A smaller p value is 0.


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean and the ends of its 95 % interval."""

    mean: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Part:
    """One part of the variance of a mean, and the degrees of freedom of its estimate."""

    variance: float
    freedom: float


def estimate(scores: np.ndarray, bounds: Bounds = RETURNS) -> Estimate:
    """Mean of scores (seeds, settings) with its interval, whose parts are the settings and, if several, the seeds.

    `bounds` are the smallest and the largest possible score. Equal scores give equal bits.
    """
    return interval(float(scores.mean()), [part_of_settings(scores), *parts_of_seeds(scores)], bounds)


def part_of_settings(scores: np.ndarray) -> Part:
    """What the draw of settings adds to the variance of the mean of scores (seeds, settings)."""
    return part_of_mean(scores.sum(axis=0), len(scores))


def parts_of_seeds(scores: np.ndarray) -> list[Part]:
    """What the draw of seeds adds to the variance of the mean of scores (seeds, settings); nothing for one seed."""
    return [part_of_mean(scores.sum(axis=1), scores.shape[1])] if len(scores) > 1 else []


def part_of_mean(sums: np.ndarray, size: int) -> Part:
    """The variance of the mean of `sums / size`, with sums (n,); infinite for n = 1.

    Sums of whole numbers and of their squares are exact, so the result is the same on every machine.
    """
    n = len(sums)
    if n == 1:
        return Part(math.inf, 1.0)
    squares = n * float(sums @ sums) - float(sums.sum()) ** 2
    return Part(max(squares, 0.0) / (n * n * (n - 1.0) * size * size), n - 1.0)


def interval(mean: float, parts: Sequence[Part], bounds: Bounds) -> Estimate:
    """A mean with the interval of `half_width`, cut at `bounds`."""
    half = half_width(parts)
    return Estimate(mean, max(mean - half, bounds[0]), min(mean + half, bounds[1]))


def half_width(parts: Sequence[Part], tail: float = 1.0 - LEVEL) -> float:
    """Half the width of an interval that misses the true mean with a chance of at most `tail`.

    Each part counts with Student's t of its own degrees of freedom (Banerjee, Sankhya 22, 1960).
    """
    quantiles = [float(stdtrit(part.freedom, tail / 2.0)) for part in parts]
    terms = (part.variance * t * t for part, t in zip(parts, quantiles, strict=True) if part.variance > 0.0)
    return math.sqrt(math.fsum(terms))


def standard_error(parts: Sequence[Part]) -> float:
    """The standard error of a mean whose variance has these parts."""
    return math.sqrt(math.fsum(part.variance for part in parts))


def p_value(mean: float, parts: Sequence[Part]) -> float:
    """The smallest chance of missing at which the interval of a mean excludes 0; two-sided, 0 below SMALLEST."""
    size = abs(mean)
    if size == 0.0 or math.isinf(standard_error(parts)):
        return 1.0
    if half_width(parts, SMALLEST) <= size:
        return 0.0
    root = brentq(lambda log: half_width(parts, math.exp(log)) - size, math.log(SMALLEST), 0.0)
    return math.exp(cast(float, root))


def draw_counts(size: int, rng: np.random.Generator) -> np.ndarray:
    """How often each of `size` items is drawn in each resample of `size` draws: whole numbers (RESAMPLES, size)."""
    indices = rng.integers(size, size=(RESAMPLES, size))
    indices += size * np.arange(RESAMPLES)[:, None]
    return np.bincount(indices.ravel(), minlength=indices.size).reshape(indices.shape).astype(float)


def interquartile_mean(
    scores: np.ndarray, strata: np.ndarray, rng: np.random.Generator, bounds: Bounds = RETURNS
) -> Estimate:
    """Mean of the middle half of the cells with its interval; a cell is the mean score of one seed in one stratum.

    `scores` has the shape (seeds, settings), `strata` (settings,) holds labels. All strata have the same weight,
    however many settings they have. The parts of the variance come from a bootstrap of the settings within each
    stratum, and from one of the seeds.
    """
    seeds, names = len(scores), np.unique(strata)
    members = [scores[:, strata == name] for name in names]
    cells = np.stack([member.mean(axis=1) for member in members], axis=1)
    drawn = [draw_counts(member.shape[1], rng) @ member.T / member.shape[1] for member in members]
    parts = [Part(_trimmed(np.stack(drawn, axis=2)).var(), scores.shape[1] - 1.0)]
    if seeds > 1:
        resamples = _trimmed(cells[rng.integers(seeds, size=(RESAMPLES, seeds))])
        parts.append(Part(resamples.var() * seeds / (seeds - 1.0), seeds - 1.0))
    return interval(float(_trimmed(cells[None])[0]), parts, bounds)


def _trimmed(cells: np.ndarray) -> np.ndarray:
    """Interquartile means (n,) of cells (n, seeds, strata)."""
    return trim_mean(cells.reshape(len(cells), -1), TRIMMED, axis=1)
