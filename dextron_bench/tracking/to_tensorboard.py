"""Shows a training in TensorBoard: a folder of event files for each seed. Its only importer."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tensorboard.compat.proto import event_pb2, summary_pb2
from tensorboard.summary.writer.event_file_writer import EventFileWriter

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.tracking import films
from dextron_bench.tracking.training_files import Point, TrainingFiles

Event: Any = getattr(event_pb2, "Event")  # noqa: B009 (made at run time: type checkers do not know it)
Summary: Any = getattr(summary_pb2, "Summary")  # noqa: B009


class TensorBoardTracker:
    """Writes event files; the horizontal axis is the epoch."""

    def __init__(self, seeds: Sequence[int], into: Path) -> None:
        self._writers = {seed: EventFileWriter(str(into / f"seed{seed}")) for seed in seeds}

    def point(self, point: Point) -> None:
        """Adds a scalar for each value."""
        self._add(point, [Summary.Value(tag=name, simple_value=value) for name, value in point.values.items()])

    def episodes(self, point: Point, episodes: Sequence[Episode]) -> None:
        """Adds a film of each episode, which TensorBoard shows among its images."""
        for row, episode in enumerate(episodes):
            image = Summary.Image(
                width=films.STYLE.width,
                height=films.STYLE.height,
                colorspace=3,
                encoded_image_string=films.gif(episode),
            )
            self._add(point, [Summary.Value(tag=f"val/episode{row}", image=image)])

    def flush(self) -> None:
        """Writes what is in memory."""
        for writer in self._writers.values():
            writer.flush()

    def close(self) -> None:
        """Completes the files."""
        for writer in self._writers.values():
            writer.close()

    def _add(self, point: Point, values: list[Any]) -> None:
        event = Event(wall_time=time.time(), step=point.epoch, summary=Summary(value=values))
        self._writers[point.seed].add_event(event)


def create(files: TrainingFiles, into: Path) -> TensorBoardTracker:
    """A tracker that writes into a folder."""
    return TensorBoardTracker(files.seeds, into)
