"""Shows a training in TensorBoard: a folder of event files for each seed. Its only importer."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from tensorboard.compat.proto.event_pb2 import Event  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.compat.proto.summary_pb2 import Summary  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.summary.writer.event_file_writer import EventFileWriter

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.tracking import films
from dextron_bench.tracking.training_files import Point, TrainingFiles


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

    def close(self) -> None:
        """Writes what is still in memory."""
        for writer in self._writers.values():
            writer.close()

    def _add(self, point: Point, values: list[Summary.Value]) -> None:
        writer = self._writers[point.seed]
        writer.add_event(Event(wall_time=time.time(), step=point.epoch, summary=Summary(value=values)))
        if values and values[0].tag.startswith("val/"):
            writer.flush()


def create(files: TrainingFiles, into: Path) -> TensorBoardTracker:
    """A tracker that writes into a folder."""
    return TensorBoardTracker(files.seeds, into)
