"""A training of two seeds that trackers follow, and a tracker that keeps what it receives."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.tracking.training_files import Point, TrainingFiles
from dextron_bench.training import metric_rows
from tests.helpers import tiny_training
from tests.helpers.tiny_training import SEEDS

FOLDER = "runs/toy-0.1/synthetic/training-0+3"
EPOCHS, POINTS = (2, 4, 5), 5  # Evaluated epochs, and all epochs of the training.
GIF = (  # One black pixel.
    b"GIF89a\x01\x00\x01\x00\x80\x00\x00\x00\x00\x00\xff\xff\xff,\x00\x00\x00\x00\x01\x00\x01\x00\x00\x02\x02D\x01\x00;"
)


def trained(base: Path) -> TrainingFiles:
    """The files of a finished training below a folder."""
    tiny_training.train(base / FOLDER)
    return TrainingFiles(base / FOLDER, SEEDS)


class Killed(BaseException):
    """Stands for the end of the process that trains."""


def killed(folder: Path, epoch: int) -> None:
    """Trains until the metrics of an epoch are written, and ends there."""
    append = metric_rows.append

    def append_and_end(place: Path, rows: Sequence[metric_rows.MetricRow]) -> None:
        append(place, rows)
        if rows[0].epoch == epoch:
            raise Killed

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(metric_rows, "append", append_and_end)
        with pytest.raises(Killed):
            tiny_training.train(folder)


class KeepingTracker:
    """Keeps points and episodes; raises OSError for points of `refused` epochs."""

    def __init__(self, refused: Sequence[int] = ()) -> None:
        self.points: list[Point] = []
        self.shown: list[tuple[Point, Sequence[Episode]]] = []
        self.is_closed = False
        self._refused = refused

    def point(self, point: Point) -> None:
        """Keeps a point."""
        if point.epoch in self._refused:
            raise OSError("no connection")
        self.points.append(point)

    def episodes(self, point: Point, episodes: Sequence[Episode]) -> None:
        """Keeps episodes."""
        self.shown.append((point, episodes))

    def flush(self) -> None:
        """Does nothing."""

    def close(self) -> None:
        """Notes the end."""
        self.is_closed = True
