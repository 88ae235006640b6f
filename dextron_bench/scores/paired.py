"""Compares methods on equal settings: differences, and settings that flip (docs/statistics.md).

Scores are arrays (seeds, settings). A column is the same setting for all methods.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest, norm

from dextron_bench.scores import statistics
from dextron_bench.scores.statistics import RETURNS, Bounds, Part

SIGNIFICANT = 1.0 - statistics.LEVEL  # The largest p value that counts as a difference.
FEW = 6  # Settings: fewer of them, all with one sign, happen by chance in more than 5 % (sign test).
POWER = 0.8  # Chance that a difference of the size `detectable` is significant.


@dataclass(frozen=True, slots=True)
class Difference(statistics.Estimate):
    """How much more B scores than A, with its 95 % interval and the smallest difference that the test can detect.

    `p_value` is the smallest level at which the difference is significant: below 0.05 if the interval excludes 0.
    """

    detectable: float
    p_value: float

    @property
    def is_worse(self) -> bool:
        """True if B is worse beyond noise: the whole interval is below 0."""
        return self.high < 0.0


@dataclass(frozen=True, slots=True)
class Flips:
    """Settings with different outcomes: rows that more seeds of B solve than of A (n,), and rows that fewer do (m,).

    `p_value` belongs to McNemar's exact test: the chance of a split at least this uneven if the methods are equal.
    """

    gained: np.ndarray
    lost: np.ndarray
    p_value: float


def difference(a: np.ndarray, b: np.ndarray, bounds: Bounds = RETURNS) -> Difference:
    """Mean of scores B minus mean of scores A, both (seeds, settings), with the interval that `compare` uses.

    The parts of its variance are the differences of settings and, for a method with several seeds, these seeds.
    `bounds` are the smallest and the
    largest possible score. (b, a) gives the opposite of (a, b), and equal scores give equal bits.
    """
    seeds = pooled([*statistics.parts_of_seeds(a), *statistics.parts_of_seeds(b)])
    sums = len(a) * b.sum(axis=0) - len(b) * a.sum(axis=0)
    parts = [_part_of_few(sums) or statistics.part_of_mean(sums, len(a) * len(b)), *seeds]
    mean = float(b.mean() - a.mean())
    estimate = statistics.interval(mean, parts, _bounds_of_difference(bounds))
    return Difference(estimate.mean, estimate.low, estimate.high, detectable(parts), statistics.p_value(mean, parts))


def _part_of_few(sums: np.ndarray) -> Part | None:
    """An infinite part if fewer than FEW settings have the same difference, which says nothing of its spread."""
    if len(sums) < FEW and sums.any() and (sums == sums[0]).all():
        return Part(math.inf, max(len(sums) - 1.0, 1.0))
    return None


def _bounds_of_difference(bounds: Bounds) -> Bounds:
    return bounds[0] - bounds[1], bounds[1] - bounds[0]


def pooled(seeds: Sequence[Part]) -> list[Part]:
    """One part for the seeds of both methods, with Welch's degrees of freedom; none if no method has several seeds."""
    variance = math.fsum(part.variance for part in seeds)
    if variance == 0.0:
        return []
    return [Part(variance, variance**2 / math.fsum(part.variance**2 / part.freedom for part in seeds))]


def detectable(parts: Sequence[Part]) -> float:
    """The smallest true difference that a test at 5 % detects with a chance of 80 %, given the noise.

    The size is half the width of the interval and 0.84 standard errors: 2.8 standard errors if no seeds differ.
    Infinite for one setting.
    """
    return statistics.half_width(parts) + float(norm.ppf(POWER)) * statistics.standard_error(parts)


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's correction: with all of them at most 5 %, the chance of any false one is at most 5 % (Holm, 1979)."""
    order = sorted(range(len(p_values)), key=lambda place: p_values[place])
    corrected, largest = [1.0] * len(p_values), 0.0
    for position, place in enumerate(order):
        largest = max(largest, min(1.0, (len(p_values) - position) * p_values[place]))
        corrected[place] = largest
    return corrected


def flips(a: np.ndarray, b: np.ndarray) -> Flips:
    """Rows that flip between successes A and B, booleans (seeds, settings), with McNemar's exact test.

    The seeds of a setting are not independent, so each setting counts once: gained or lost by the number of seeds
    that solve it. Only the first seeds count if one method has more: with three seeds against one, "more seeds solve
    it" would favour one side even between equal methods. With one seed each, this is McNemar's test.
    """
    seeds = min(len(a), len(b))
    more = b[:seeds].sum(axis=0, dtype=int) - a[:seeds].sum(axis=0, dtype=int)
    gained, lost = np.flatnonzero(more > 0), np.flatnonzero(more < 0)
    changed = len(gained) + len(lost)
    return Flips(gained, lost, float(binomtest(len(gained), changed).pvalue) if changed else 1.0)
