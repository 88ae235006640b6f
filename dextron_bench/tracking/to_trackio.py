"""Shows a training in trackio: a run of its local database for each seed. Its only importer.

The database lies with the files of the tracker, or in the folder that TRACKIO_DIR names.
"""

from __future__ import annotations

import contextvars
import importlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.tracking import films
from dextron_bench.tracking.training_files import Point, TrainingFiles

if TYPE_CHECKING:
    from types import ModuleType

PROJECT = "dextron-bench"


class TrackioTracker:
    """Writes a run for each seed, grouped by method and source of reaches; its step is the epoch."""

    def __init__(self, trackio: ModuleType, files: TrainingFiles, into: Path) -> None:
        self._trackio, self._into = trackio, into
        label, reaches = files.name.split("/")[:2]
        self._runs: dict[int, Any] = {}
        for seed in files.seeds:  # In a context of its own, because trackio ends the run of its context.
            self._runs[seed] = contextvars.copy_context().run(
                trackio.init,
                project=PROJECT,
                name=f"{label} {reaches} seed{seed}",
                group=f"{label}/{reaches}",
                config=files.config() | {"seed": seed},
                embed=False,
                auto_log_gpu=False,
                auto_log_cpu=False,
            )

    def point(self, point: Point) -> None:
        """Logs the values of an epoch or an evaluation."""
        self._runs[point.seed].log(dict(point.values), step=point.epoch)

    def episodes(self, point: Point, episodes: Sequence[Episode]) -> None:
        """Logs a film of each episode."""
        videos = {}
        for row, episode in enumerate(episodes):
            file = self._into / f"episode-{point.epoch}-seed{point.seed}-{row}.gif"
            file.write_bytes(films.gif(episode))
            videos[f"val/episode{row}"] = self._trackio.Video(str(file))
        self._runs[point.seed].log(videos, step=point.epoch)

    def flush(self) -> None:
        """Does nothing: the library writes by itself."""

    def close(self) -> None:
        """Ends the runs."""
        for run in self._runs.values():
            run.finish()


def create(files: TrainingFiles, into: Path) -> TrackioTracker:
    """A tracker that writes into a folder."""
    into.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("TRACKIO_DIR", str(into))  # Trackio reads it when it is loaded.
    trackio = importlib.import_module("trackio")

    return TrackioTracker(trackio, files, into)
