"""Scans of the critical distance: how hard a setting is, from experts with evenly spaced d_c."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.experts import blocks, outcomes, policies
from dextron_bench.reaches import setting
from dextron_bench.splits.near_equal import SETTING
from dextron_bench.storage import tables
from dextron_bench.world import bottle, task
from dextron_bench.world.engine import Engine

RANGE = policies.CRITICAL_DISTANCE[1] - policies.CRITICAL_DISTANCE[0]  # Width of the range of d_c.
BLOCK = 32  # Settings that are played and stored together.
DRAW = [*SETTING, "gain"]


@dataclass(frozen=True)
class Scanner:
    """Plays experts on settings of a source. What it has played is kept in a folder, if it has one, and read again."""

    source: setting.Source
    engine: Engine
    folder: Path | None = None

    def __post_init__(self) -> None:
        if self.folder is not None:
            blocks.write_or_check({"reaches": self.source.name, "block": BLOCK}, self.folder)

    def scan(self, rows: pd.DataFrame, points: int) -> np.ndarray:
        """Sums of rewards (rows, points) of experts with each row's gain and the evenly spaced d_c of `grid`."""
        return self.play(rows, np.tile(grid(points), (len(rows), 1)))

    def play(self, rows: pd.DataFrame, criticals: np.ndarray) -> np.ndarray:
        """Sums of rewards (rows, points) of experts with each row's gain and critical distances (rows, points)."""
        points = criticals.shape[1]
        columns = [name for name in (*DRAW, *bottle.COLUMNS) if name in rows]
        draws = rows[columns].loc[rows.index.repeat(points)].reset_index(drop=True).assign(critical=criticals.ravel())
        parts = [draws.iloc[first : first + BLOCK * points] for first in range(0, len(draws), BLOCK * points)]
        scores = [self._stored(part) for part in parts]
        missing = ((k, part) for k, part in enumerate(parts) if scores[k] is None)
        for k, played in outcomes.play_blocks(self.source, self.engine, missing, points):
            scores[k] = played["score"].to_numpy()
            if self.folder is not None:
                tables.write(self._file(parts[k]), played, compression="zstd")
        return np.concatenate([np.zeros(0), *(part for part in scores if part is not None)]).reshape(-1, points)

    def _stored(self, draws: pd.DataFrame) -> np.ndarray | None:
        """The scores of a part that was played before; raises DamagedBlock."""
        if self.folder is None or not (file := self._file(draws)).exists():
            return None
        played = blocks.read(file)
        blocks.check(file, played, draws)
        return played["score"].to_numpy()

    def _file(self, draws: pd.DataFrame) -> Path:
        assert self.folder is not None
        return self.folder / f"{tables.digest(draws)[:16]}.parquet"


def grid(points: int) -> np.ndarray:
    """The middles (points,) of equal bands of d_c."""
    return policies.CRITICAL_DISTANCE[0] + RANGE * (np.arange(points) + 0.5) / points


def success_window(scores: np.ndarray) -> np.ndarray:
    """Widths (rows,) of the range of d_c that succeeds, from a scan (rows, points)."""
    return RANGE * (scores == task.SUCCESS).mean(axis=1)


def best_critical(scores: np.ndarray) -> np.ndarray:
    """The best d_c (rows,) of a scan (rows, points): the middle of the longest run of points with the highest score."""
    return grid(scores.shape[1])[[_middle(row == row.max()) for row in scores]]


def _middle(flags: Sequence[bool]) -> int:
    """The index in the middle of the longest run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    runs = edges.reshape(-1, 2)
    start, stop = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return int((start + stop - 1) // 2)
