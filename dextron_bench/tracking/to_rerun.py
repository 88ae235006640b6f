"""Shows a training in Rerun: in a file, or live in its viewer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.recording.training_view import Connect, TrainingView
from dextron_bench.tracking.training_files import Point, TrainingFiles
from dextron_bench.world import task

FILE = "training.rrd"


class RerunTracker:
    """Sends curves and episodes to a view of Rerun."""

    def __init__(self, files: TrainingFiles, connect: Connect) -> None:
        self._view = TrainingView(connect, files.name, files.seeds)

    def point(self, point: Point) -> None:
        """Adds the values to the curves."""
        self._view.values(point.seed, point.epoch, point.step, point.values)

    def episodes(self, point: Point, episodes: Sequence[Episode]) -> None:
        """Adds episodes, one after another."""
        scores = f"return {point.values['val/return']:.2f}, {100 * point.values['val/success']:.0f} % on val"
        titles = [
            f"**Epoch {point.epoch}**: {scores}\n\nrow {row}: return {episode.score:g} of {task.SUCCESS:g}"
            for row, episode in enumerate(episodes)
        ]
        self._view.episodes(point.seed, point.step, titles, episodes)

    def flush(self) -> None:
        """Lays out what is new."""
        self._view.flush()

    def close(self) -> None:
        """Completes the file."""
        self._view.close()


def create(files: TrainingFiles, into: Path) -> RerunTracker:
    """A tracker that writes one file into a folder."""
    into.mkdir(parents=True, exist_ok=True)
    return RerunTracker(files, lambda stream: stream.save(into / FILE))
