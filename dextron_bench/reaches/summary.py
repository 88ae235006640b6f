"""Statistics of a source: number, duration, length and speed of its reaches, by subject and start region."""

from __future__ import annotations

import numpy as np
import pandas as pd

from dextron_bench.reaches.setting import ReachSource, Setting, Source
from dextron_bench.reaches.timing import CONTROL_STEP

MEASURES = ("duration", "length", "speed")


def reach_table(source: Source) -> pd.DataFrame:
    """A table of one row for each reach: name, subject, ring, angle, duration [s], length [m] and mean speed [m/s].

    The palm's carrier is measured. Recorded and synthetic reaches are measured before an episode scales their duration.
    """
    rows = []
    for name in source.names:
        stratum = source.stratum(name)
        duration, length = _motion(source, name)
        rows.append((name, stratum.subject, stratum.ring, stratum.angle, duration, length, length / duration))
    return pd.DataFrame(rows, columns=["name", "subject", "ring", "angle", *MEASURES])


def group_means(reaches: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Number of reaches and mean of each measure, for each group of a `reach_table`, sorted by group."""
    columns = {"reaches": ("name", "size")} | {measure: (measure, "mean") for measure in MEASURES}
    return reaches.groupby(by, as_index=False, sort=True).agg(**columns)


def _motion(source: Source, name: str) -> tuple[float, float]:
    """Duration [s] and length [m] of a reach."""
    if isinstance(source, ReachSource):
        reach = source.reach(name)
        return reach.duration, path_length(reach.positions)
    positions = source.path(Setting(name, 0.0, 0.0, 0.0)).positions
    return (len(positions) - 1) * CONTROL_STEP, path_length(positions)


def path_length(positions: np.ndarray) -> float:
    """Length [m] of the polyline through positions [m] (n, 3)."""
    return float(np.sqrt((np.diff(positions, axis=0) ** 2).sum(axis=1)).sum())
