"""How much methods lose under tracks: paired differences to the plain split, and one number for the delays."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from dextron_bench.evaluation.results import Result
from dextron_bench.reaches.timing import CONTROL_STEP
from dextron_bench.scores import statistics
from dextron_bench.splits.tracks import DELAYS, PLUS, TRACKS
from dextron_bench.world import task


@dataclass(frozen=True, slots=True)
class Robustness:
    """What a method scores on a split under tracks.

    `seeds` have played some track, and `plain` is their mean return without one. `returns` and `losses` are, by track,
    the mean return and how much lower it is; seeds and settings are paired, so the interval is of the differences.
    `area` is the mean of the return over delays from 0 to 300 ms, divided by the return of a success; NaN if some delay
    was not played.
    """

    reaches: str
    split: str
    method: str
    seeds: int
    plain: float
    returns: Mapping[str, float]
    losses: Mapping[str, statistics.Estimate]
    area: float


def table(results: Iterable[Result]) -> list[Robustness]:
    """The methods that have played a split plainly and under some track, the best area first within a split.

    Only seeds that have played both are compared. The order of methods without an area follows their plain return.
    """
    scores: dict[tuple[str, str, str], list[Mapping[str, list[float]]]] = defaultdict(list)
    for result in results:
        for split in {name.partition(PLUS)[0] for name in result.splits if PLUS in name}:
            if split in result.splits:
                played = {name: part.scores for name, part in result.splits.items() if _base(name) == split}
                scores[result.reaches, split, result.method].append(played)
    rows = [_robustness(*key, seeds) for key, seeds in scores.items()]
    return sorted(rows, key=lambda row: (row.reaches, row.split, -np.nan_to_num(row.area, nan=-1.0), -row.plain))


def area(plain: float, returns: Mapping[str, float]) -> float:
    """The mean return over delays from 0 to 300 ms by the trapezoidal rule, from 0 to 1; NaN if one is missing."""
    steps = np.array([0, *DELAYS.values()])
    means = np.array([plain, *(returns.get(f"delay-{duration}", np.nan) for duration in DELAYS)])
    return float(np.trapezoid(means, steps * CONTROL_STEP) / (steps[-1] * CONTROL_STEP) / task.SUCCESS)


def _robustness(reaches: str, split: str, method: str, seeds: list[Mapping[str, list[float]]]) -> Robustness:
    plain = float(np.mean([seed[split] for seed in seeds]))
    returns, losses = {}, {}
    for track in TRACKS:
        name = f"{split}{PLUS}{track}"
        both = [(seed[name], seed[split]) for seed in seeds if name in seed]
        if both:
            under, without = (np.array(part, float) for part in zip(*both, strict=True))
            returns[track] = float(under.mean())
            losses[track] = statistics.estimate(without - under, (-task.SUCCESS, task.SUCCESS))
    return Robustness(reaches, split, method, len(seeds), plain, returns, losses, area(plain, returns))


def _base(name: str) -> str:
    return name.partition(PLUS)[0]
