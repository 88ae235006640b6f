"""What a source of reaches holds: how many, how long, how far and how fast, by subject and start region."""

from __future__ import annotations

import numpy as np
import pandas as pd

from dextron_bench.reaches.reach import CONTROL_STEP
from dextron_bench.reaches.setting import ReachSource, Setting, Source

MEASURES = ("duration", "length", "speed")


def survey(source: Source) -> pd.DataFrame:
    """One row a reach: name, subject, ring, angle, duration [s], path length [m] and mean speed [m/s] of the carrier.

    Recorded and synthetic reaches are measured as they are, before an episode stretches their time.
    """
    rows = []
    for name in source.names:
        stratum = source.stratum(name)
        duration, length = _motion(source, name)
        rows.append((name, stratum.subject, stratum.ring, stratum.angle, duration, length, length / duration))
    return pd.DataFrame(rows, columns=["name", "subject", "ring", "angle", *MEASURES])


def means(reaches: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Number of reaches and mean of each measure for each group of a survey, sorted by group."""
    wanted = {"reaches": ("name", "size")} | {measure: (measure, "mean") for measure in MEASURES}
    return reaches.groupby(by, as_index=False, sort=True).agg(**wanted)


def _motion(source: Source, name: str) -> tuple[float, float]:
    """Duration [s] and path length [m] of a reach."""
    if isinstance(source, ReachSource):
        reach = source.reach(name)
        return reach.duration, path_length(reach.positions)
    positions = source.path(Setting(name, 0.0, 0.0, 0.0)).positions
    return (len(positions) - 1) * CONTROL_STEP, path_length(positions)


def path_length(positions: np.ndarray) -> float:
    """Length [m] of the polygon through positions [m] (n, 3)."""
    return float(np.sqrt((np.diff(positions, axis=0) ** 2).sum(axis=1)).sum())
