"""Ranks of a round: mean success on the splits that the paper has not, and one margin for all pairs.

What a method solves is, by split, an array (seeds, settings) of zeros and ones; a column is the same setting for all
methods of a round. docs/leaderboard.md explains the rank.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dextron_bench.scores import statistics
from dextron_bench.scores.statistics import Estimate, Part

QUANTILE = 2.58  # Standard errors; a difference of two equal methods exceeds them once in a hundred times.
SEEDS = 3.0  # Trainings of a learner.

Solved = Mapping[str, np.ndarray]


class Margin(NamedTuple):
    """The margin of a round, a share of settings, and its parts: standard errors of a difference of two methods.

    `settings` is the median over pairs of baselines, for paired settings; `seeds` follows from the median over
    baselines of the variance between their seeds.
    """

    size: float
    settings: float
    seeds: float


def score(solved: Solved) -> float:
    """The mean over splits of the share of settings that a method solves, averaged over its seeds; in [0, 1]."""
    return math.fsum(float(part.mean()) for part in solved.values()) / len(solved)


def estimate(solved: Solved) -> Estimate:
    """The score with its 95 % interval, whose parts are the settings of each split and, if several, the seeds."""
    settings = [statistics.part_of_settings(part) for part in solved.values()]
    parts = [Part(part.variance / len(settings) ** 2, part.freedom) for part in settings]
    if (seeds := _seeds(solved)) > 1:
        parts.append(Part(float(np.var(seed_scores(solved), ddof=1)) / seeds, seeds - 1.0))
    return statistics.interval(score(solved), parts, statistics.SHARES)


def seed_scores(solved: Solved) -> list[float]:
    """The score of each seed."""
    return [score({name: part[[seed]] for name, part in solved.items()}) for seed in range(_seeds(solved))]


def margin(baselines: Sequence[Solved]) -> Margin:
    """The margin that follows from what baselines solve: it must not depend on entries, who could choose their spread.

    QUANTILE times the root of the median squared standard error of the difference of two baselines, plus 2 / SEEDS of
    the median variance between seeds of the baselines that have several.
    """
    pairs = [_variance_of_difference(a, b) for a, b in itertools.combinations(baselines, 2)]
    spreads = [float(np.var(seed_scores(solved), ddof=1)) for solved in baselines if _seeds(solved) > 1]
    settings = float(np.median(pairs)) if pairs else 0.0
    seeds = 2.0 / SEEDS * float(np.median(spreads)) if spreads else 0.0
    return Margin(QUANTILE * math.sqrt(settings + seeds), math.sqrt(settings), math.sqrt(seeds))


def ranks(scores: Mapping[str, float], margin: float, authors: Mapping[str, str]) -> dict[str, int]:
    """Rank of each method by name: 1 + the number of methods whose score is higher by more than the margin.

    Methods of one author count once together. A method without an entry in `authors` is one by itself. So a lower
    score never has a better rank, and no method changes the order of two others.
    """
    return {
        name: 1 + len({authors.get(other, (other,)) for other, score in scores.items() if score > lower + margin})
        for name, lower in scores.items()
    }


def _variance_of_difference(a: Solved, b: Solved) -> float:
    """The squared standard error of the difference of two scores over paired settings."""
    parts = [_part(a[name], b[name]) for name in a]
    return math.fsum(part.variance for part in parts) / len(parts) ** 2


def _part(a: np.ndarray, b: np.ndarray) -> Part:
    return statistics.part_of_mean(len(a) * b.sum(axis=0) - len(b) * a.sum(axis=0), len(a) * len(b))


def _seeds(solved: Solved) -> int:
    return len(next(iter(solved.values())))
