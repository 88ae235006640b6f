"""A paired test that may stop at any time: a betting e-process on differences of scores (docs/statistics.md).

A gambler bets against "B scores no more than A" with a fixed share of the capital on each setting. If that is true,
no strategy makes the capital grow, whenever the gambler stops: it reaches 40 times its start with a chance of at most
2.5 % (Ville, 1939). The capital is the mean over gamblers with different shares (Waudby-Smith and Ramdas, 2024).
Another gambler bets on the other side, so a decision is false with a chance of at most 5 %.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from dextron_bench.scores import statistics

SHARES = (np.arange(40) + 0.5) / 40  # Of the largest bet that cannot lose more than the capital.
ENOUGH = 2.0 / (1.0 - statistics.LEVEL)  # The capital of one side that decides: two sides share the 5 %.
STEPS = 400  # Tested means on each side of 0, for the interval.


@dataclass(frozen=True, slots=True)
class Decision:
    """What the differences of n settings decide.

    `after` is the number of settings after which one side had ENOUGH capital, None if none had; then `sign` is 1 if B
    scores more and -1 if A does, else 0. `capital` is the largest capital of both sides so far. The true mean lies in
    the interval from `low` to `high` at all times together with a chance of at least 95 %.
    """

    after: int | None
    sign: int
    capital: float
    low: float
    high: float


def decide(differences: np.ndarray, largest: float) -> Decision:
    """The decision on differences B - A (n,) of settings in a random order, each from -`largest` to `largest`."""
    scaled = np.asarray(differences, float) / largest
    after, sign = first_decision(scaled)
    best = log_capitals(scaled, 0.0).max(initial=0.0)
    low, high = _interval(scaled)
    return Decision(after, sign, float(np.exp(best)), largest * low, largest * high)


def first_decision(scaled: np.ndarray) -> tuple[int | None, int]:
    """After how many differences (n,) in [-1, 1] a side has ENOUGH, and its sign; (None, 0) if no side has."""
    above = log_capitals(scaled, 0.0) >= np.log(ENOUGH)
    rows = np.flatnonzero(above.any(axis=1))
    return (int(rows[0]) + 1, 1 if above[rows[0], 0] else -1) if rows.size else (None, 0)


def log_capitals(scaled: np.ndarray, mean: float) -> np.ndarray:
    """Logarithms of the capital after each difference (n,) in [-1, 1], shape (n, 2).

    The first column bets that the true mean is above `mean`, the second that it is below; -1 < mean < 1.
    """
    excess = scaled[:, None] - mean
    bets = excess * SHARES / (1.0 + mean), -excess * SHARES / (1.0 - mean)
    return np.stack([logsumexp(np.cumsum(np.log1p(bet), axis=0), axis=1) for bet in bets], axis=1) - np.log(len(SHARES))


def _interval(scaled: np.ndarray) -> tuple[float, float]:
    """The smallest and the largest mean that no capital has refuted; a capital is smaller for a mean further on."""
    if not len(scaled):
        return -1.0, 1.0
    means = (np.arange(1 - STEPS, STEPS) / STEPS).tolist()

    def is_refuted(mean: float, side: int) -> bool:
        return bool(log_capitals(scaled, mean)[:, side].max() >= np.log(ENOUGH))

    low = bisect_left(means, True, key=lambda mean: not is_refuted(mean, 0))
    high = bisect_left(means, True, key=lambda mean: is_refuted(mean, 1))
    return [-1.0, *means][low], [*means, 1.0][high]
