"""Settings that are nearly the same: no split may have one that another split has."""

from __future__ import annotations

import numpy as np
import pandas as pd

SETTING = ["reach", "offset_x", "offset_y", "duration_noise"]

# Two settings of one reach are near-equal if offsets in x and y, and duration noise, differ by less than these.
NEAR_OFFSET = 0.001  # [m]
NEAR_NOISE = 0.02


def without_near_equal(rows: pd.DataFrame, held_out: pd.DataFrame) -> pd.DataFrame:
    """The rows whose setting is not near-equal to a setting of the held-out rows."""
    by_reach = {name: group[SETTING[1:]].to_numpy() for name, group in held_out.groupby("reach")}
    limits = np.array([NEAR_OFFSET, NEAR_OFFSET, NEAR_NOISE])

    def near(row: tuple) -> bool:
        others = by_reach.get(row[0])
        return others is not None and bool((np.abs(others - np.array(row[1:])) < limits).all(axis=1).any())

    keep = [not near(row) for row in rows[SETTING].itertuples(index=False, name=None)]
    return rows[keep]
