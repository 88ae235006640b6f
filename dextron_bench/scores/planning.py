"""How many settings and seeds show a difference of a given size, from the noise of results (docs/statistics.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dextron_bench.scores import paired
from dextron_bench.scores.statistics import Part

MOST = 1_000_000  # Settings; a plan that needs more is none.


@dataclass(frozen=True, slots=True)
class Noise:
    """Variances behind the difference of two methods.

    `settings` is the variance between settings of the expected difference. `seeds` and `both` have an element for each
    method with several seeds: the variance between seeds of their expected means, and the variance that remains for one
    seed on one setting. A method with one seed has none: its noise is part of `settings`.
    """

    settings: float
    seeds: tuple[float, ...]
    both: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class SampleSize:
    """The fewest settings that show the difference with so many seeds for each method of several.

    `settings` is None if MOST settings are too few. `episodes` counts the episodes of both methods.
    """

    seeds: int
    settings: int | None
    episodes: int | None


def noise(a: np.ndarray, b: np.ndarray) -> Noise:
    """The noise of two methods with scores (seeds, settings) on the same settings, by analysis of variance."""
    several = [scores for scores in (a, b) if len(scores) > 1]
    both = [_both(scores) for scores in several]
    seeds = [
        max(float(scores.mean(axis=1).var(ddof=1)) - rest / scores.shape[1], 0.0)
        for scores, rest in zip(several, both, strict=True)
    ]
    spread = float((b.mean(axis=0) - a.mean(axis=0)).var(ddof=1))
    shares = math.fsum(rest / len(scores) for scores, rest in zip(several, both, strict=True))
    return Noise(max(spread - shares, 0.0), tuple(seeds), tuple(both))


def _both(scores: np.ndarray) -> float:
    """The mean square of scores (seeds, settings) that neither the seed nor the setting explains."""
    rest = scores - scores.mean(axis=0) - scores.mean(axis=1)[:, None] + scores.mean()
    return float((rest**2).sum()) / ((scores.shape[0] - 1) * (scores.shape[1] - 1))


def detectable(known: Noise, settings: int, seeds: int) -> float:
    """The difference that the test at 5 % detects four times in five, with so many settings and seeds."""
    between = (known.settings + math.fsum(known.both) / seeds) / settings
    means = [
        Part((one + rest / settings) / seeds, seeds - 1.0) for one, rest in zip(known.seeds, known.both, strict=True)
    ]
    return paired.detectable([Part(between, settings - 1.0), *(paired.pooled(means) if seeds > 1 else [])])


def plans(known: Noise, difference: float, seeds: Sequence[int]) -> list[SampleSize]:
    """A plan for each number of seeds; one plan if no method has several seeds."""
    return [_plan(known, difference, number) for number in (seeds if known.seeds else [1])]


def _plan(known: Noise, difference: float, seeds: int) -> SampleSize:
    if detectable(known, MOST, seeds) > difference:
        return SampleSize(seeds, None, None)
    low, high = 1, MOST  # Too few, and enough.
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if detectable(known, middle, seeds) <= difference else (middle, high)
    singles = 2 - len(known.seeds)
    return SampleSize(seeds, high, high * (singles + seeds * len(known.seeds)))
