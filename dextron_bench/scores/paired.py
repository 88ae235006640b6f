"""Compares methods on equal settings: differences, settings that flip, and ranks (docs/statistics.md).

Scores are arrays (seeds, settings). A column is the same setting for all methods.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest, norm

from dextron_bench.scores import statistics

NOISE = 3.29  # Standard errors; a difference due to chance exceeds them once in two thousand times.
POWER = 0.8  # Chance that a difference of the size `detectable` is significant.


@dataclass(frozen=True, slots=True)
class Difference(statistics.Estimate):
    """How much more B scores than A, with its 95 % interval and the smallest difference that the test can detect."""

    detectable: float

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


def difference(a: np.ndarray, b: np.ndarray, rng: np.random.Generator, same_settings: bool = True) -> Difference:
    """Mean of scores B minus mean of scores A, both (seeds, settings), by a bootstrap of the difference.

    Each resample draws settings once for both methods, and seeds for each method separately. Equal generators give
    opposite differences for (a, b) and (b, a). Without `same_settings`, it draws the settings of each separately, too.
    """
    settings = statistics.draw_counts(a.shape[1], rng) if same_settings else None
    swap = b.tobytes() < a.tobytes()  # The order of the draws must not depend on which method is called A.
    first, second = (_resampled(scores, settings, rng) for scores in ((b, a) if swap else (a, b)))
    resamples = first - second if swap else second - first
    estimate = statistics.interval(float(b.mean() - a.mean()), resamples)
    return Difference(estimate.mean, estimate.low, estimate.high, detectable(resamples))


def _resampled(scores: np.ndarray, settings: np.ndarray | None, rng: np.random.Generator) -> np.ndarray:
    """Means of resamples with given counts of settings, or with counts that are drawn here."""
    counts = statistics.draw_counts(scores.shape[1], rng) if settings is None else settings
    return statistics.resampled_means(scores, counts, rng)


def published_difference(a: np.ndarray, b: np.ndarray, same_settings: bool = True) -> Difference:
    """The difference that ranks and `compare` use: equal scores give the same interval everywhere."""
    return difference(a, b, np.random.default_rng(0), same_settings)


@dataclass(frozen=True, slots=True)
class Gap(statistics.Estimate):
    """How much more a method scores on known settings than on fresh ones, with its 95 % interval.

    `is_beyond_noise` is true if it exceeds NOISE standard errors: few honest rows of a large board may do so by chance.
    """

    is_beyond_noise: bool


def gap(known: np.ndarray, fresh: np.ndarray, rng: np.random.Generator) -> Gap:
    """Mean of scores on known settings minus mean on fresh settings, both (seeds, settings) of one method.

    Each resample draws the two kinds of settings independently, and the same seeds for both.
    """
    seeds = statistics.draw_counts(len(known), rng)
    known_means, fresh_means = (
        (seeds * (statistics.draw_counts(scores.shape[1], rng) @ scores.T)).sum(axis=1) / scores.size
        for scores in (known, fresh)
    )
    resamples = known_means - fresh_means
    estimate = statistics.interval(float(known.mean() - fresh.mean()), resamples)
    beyond = estimate.mean > NOISE * float(resamples.std())
    return Gap(estimate.mean, estimate.low, estimate.high, beyond)


def detectable(resamples: np.ndarray) -> float:
    """The smallest true difference that a test at 5 % detects with a chance of 80 %, given the noise of the resamples.

    The size is 2.8 standard errors. `resamples` (RESAMPLES,) are resamples of the difference.
    """
    return float((norm.ppf(1.0 - statistics.TAIL) + norm.ppf(POWER)) * resamples.std())


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


def ranks(scores: Sequence[np.ndarray], own_settings: Collection[int] = ()) -> list[int]:
    """Ranks from 1; methods that do not differ significantly from the best of their group share its rank.

    Methods are taken from the highest mean down. A method starts a new group if the interval of its
    `published_difference` from the first method of the current group excludes 0; its rank is then its position.
    Each entry of `scores` is (seeds, settings) on the same settings; those at the places `own_settings` are on settings
    that no other method has. Equal means are ordered by their scores, so the
    order of the input does not matter.
    """
    order = sorted(range(len(scores)), key=lambda method: (-scores[method].mean(), scores[method].tobytes()))
    method_ranks, rank, leader = [0] * len(scores), 0, -1
    for position, method in enumerate(order, start=1):
        same = method not in own_settings and leader not in own_settings
        if rank == 0 or _is_significant(published_difference(scores[leader], scores[method], same)):
            leader, rank = method, position
        method_ranks[method] = rank
    return method_ranks


def _is_significant(result: Difference) -> bool:
    return result.low > 0.0 or result.high < 0.0
