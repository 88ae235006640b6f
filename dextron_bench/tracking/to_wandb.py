"""Shows a training in Weights & Biases: a run of theirs for each seed. Its only importer.

Nothing leaves the machine unless the environment has WANDB_MODE=online: `wandb sync` sends the folders later.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import wandb  # pyright: ignore[reportMissingImports]  # Of an extra.

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.tracking import films
from dextron_bench.tracking.training_files import Point, TrainingFiles

PROJECT = "dextron-bench"


class WandbTracker:
    """Writes a run for each seed, grouped by method and source of reaches; the horizontal axis is the epoch."""

    def __init__(self, files: TrainingFiles, into: Path) -> None:
        self._into = into
        into.mkdir(parents=True, exist_ok=True)
        label, reaches = files.name.split("/")[:2]
        self._runs: dict[int, Any] = {}
        for seed in files.seeds:
            run = wandb.init(
                project=os.environ.get("WANDB_PROJECT", PROJECT),
                group=f"{label}/{reaches}",
                name=f"{label} {reaches} seed{seed}",
                config=files.config() | {"seed": seed},
                dir=str(into),
                mode=os.environ.get("WANDB_MODE", "offline"),  # type: ignore[arg-type]
                reinit="create_new",
                settings=wandb.Settings(silent=True, console="off"),
            )
            run.define_metric("*", step_metric="epoch")
            self._runs[seed] = run

    def point(self, point: Point) -> None:
        """Logs the values of an epoch or an evaluation."""
        self._runs[point.seed].log({"epoch": point.epoch, **point.values})

    def episodes(self, point: Point, episodes: Sequence[Episode]) -> None:
        """Logs a film of each episode."""
        videos = {}
        for row, episode in enumerate(episodes):
            file = self._into / f"episode-{point.epoch}-seed{point.seed}-{row}.gif"
            file.write_bytes(films.gif(episode))
            videos[f"val/episode{row}"] = wandb.Video(str(file), format="gif")
        self._runs[point.seed].log({"epoch": point.epoch, **videos})

    def flush(self) -> None:
        """Does nothing: the library writes by itself."""

    def close(self) -> None:
        """Ends the runs."""
        for run in self._runs.values():
            run.finish()


def create(files: TrainingFiles, into: Path) -> WandbTracker:
    """A tracker that writes into a folder."""
    return WandbTracker(files, into)
