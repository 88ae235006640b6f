"""Methods compared on equal settings: differences, settings that flip, and ranks (docs/statistics.md).

Scores are arrays (seeds, settings) whose columns are the same settings for all methods.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest, norm

from dextron_bench.scores import statistics

POWER = 0.8  # Chance with which a difference of the size `detectable` shows.


@dataclass(frozen=True, slots=True)
class Difference(statistics.Estimate):
    """What B scores more than A, with its 95 % interval, and the smallest difference that would be told from none."""

    detectable: float

    @property
    def is_worse(self) -> bool:
        """Whether B is worse beyond noise."""
        return self.high < 0.0


@dataclass(frozen=True, slots=True)
class Flips:
    """Settings whose outcome differs: rows (n,) that more seeds of B solve than of A, rows (m,) that fewer do.

    `p_value` is that of McNemar's exact test: how likely so uneven a share is where neither method is better.
    """

    gained: np.ndarray
    lost: np.ndarray
    p_value: float


def difference(a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> Difference:
    """Mean of scores B less that of A, each (seeds, settings), by a bootstrap of the difference.

    Each resample draws settings once, for both, and seeds for each method by itself. Equal generators give
    opposite differences for (a, b) and (b, a).
    """
    settings = statistics.drawn(a.shape[1], rng)
    swap = b.tobytes() < a.tobytes()  # Seeds are drawn in an order that does not hang on which is called A.
    first, second = (statistics.resampled(scores, settings, rng) for scores in ((b, a) if swap else (a, b)))
    resamples = first - second if swap else second - first
    found = statistics.interval(float(b.mean() - a.mean()), resamples)
    return Difference(found.mean, found.low, found.high, detectable(resamples))


def published(a: np.ndarray, b: np.ndarray) -> Difference:
    """The difference that ranks and `compare` go by: from equal scores the same interval everywhere."""
    return difference(a, b, np.random.default_rng(0))


def detectable(resamples: np.ndarray) -> float:
    """The smallest true difference that a test at 5 % would find with a chance of 80 %, where noise is as it was here.

    That is 2.8 standard errors; `resamples` (RESAMPLES,) are of the difference.
    """
    return float((norm.ppf(1.0 - statistics.TAIL) + norm.ppf(POWER)) * resamples.std())


def flips(a: np.ndarray, b: np.ndarray) -> Flips:
    """Rows that flip between successes A and B, booleans (seeds, settings), and McNemar's exact test of them.

    A setting counts once, however many seeds played it, since its seeds do not fall independently: as gained or lost
    by the number of seeds that solve it. As many seeds of either method count, the first ones, for with three seeds
    against one "more seeds solve it" would favour a side even between equals. With a seed each it is McNemar's test.
    """
    seeds = min(len(a), len(b))
    more = b[:seeds].sum(axis=0, dtype=int) - a[:seeds].sum(axis=0, dtype=int)
    gained, lost = np.flatnonzero(more > 0), np.flatnonzero(more < 0)
    changed = len(gained) + len(lost)
    return Flips(gained, lost, float(binomtest(len(gained), changed).pvalue) if changed else 1.0)


def ranks(scores: Sequence[np.ndarray]) -> list[int]:
    """Ranks from 1, shared by methods that cannot be told from the best of their group.

    From the highest mean down, a method opens a group where the interval of its difference from the method that
    opened the last one, as `published`, does not hold 0; its rank is then its place. Scores are (seeds, settings)
    each, of the same settings. Where means are equal, scores decide who opens, so that the order of methods does not.
    """
    order = sorted(range(len(scores)), key=lambda each: (-scores[each].mean(), scores[each].tobytes()))
    found, rank, opener = [0] * len(scores), 0, -1
    for place, each in enumerate(order, start=1):
        if rank == 0 or _apart(published(scores[opener], scores[each])):
            opener, rank = each, place
        found[each] = rank
    return found


def _apart(found: Difference) -> bool:
    return found.low > 0.0 or found.high < 0.0
