"""The picture of a sweep: scores on `val` against the setting that varies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from dextron_bench.scores.figures.pictures import check_format, save
from dextron_bench.scores.statistics import RETURNS, SHARES, Bounds, Estimate

WIDE = 8.0  # Ratio of the largest to the smallest value from which on the axis is logarithmic.


@dataclass(frozen=True, slots=True)
class Point:
    """A trial: the value of the setting, its mean return (0 to 20) and its success rate (0 to 1)."""

    value: float
    returns: Estimate
    successes: Estimate


def scaling(points: Sequence[Point], setting: str, title: str, file: Path) -> None:
    """Draws return and success rate with their 95 % intervals against a setting; raises UnknownFormat, OSError.

    The axis of the setting is logarithmic if all values are positive and far apart.
    """
    check_format(file)
    points = sorted(points, key=lambda point: point.value)
    values = np.array([point.value for point in points])
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    _draw(left, values, [point.returns for point in points], RETURNS, 1.0)
    _draw(right, values, [point.successes for point in points], SHARES, 100.0)
    left.set(xlabel=setting, ylabel="sum of rewards")
    right.set(xlabel=setting, ylabel="success [%]")
    figure.suptitle(title, fontsize=10)
    save(figure, file, 150)


def _draw(axes: Axes, values: np.ndarray, estimates: Sequence[Estimate], bounds: Bounds, unit: float) -> None:
    mean, low, high = (unit * np.array([getattr(one, name) for one in estimates]) for name in ("mean", "low", "high"))
    axes.errorbar(values, mean, yerr=[mean - low, high - mean], fmt="o-", capsize=3, markersize=4, linewidth=1.2)
    if len(values) and values[0] > 0.0 and values[-1] >= WIDE * values[0]:
        axes.set_xscale("log")
        axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks(values, [f"{value:g}" for value in values])
    axes.set_ylim(top=min(axes.get_ylim()[1], 1.01 * unit * bounds[1]))
    axes.grid(axis="y", color="0.9")
