"""Shows a training in Weights & Biases, or in trackio, which has its interface: a run of theirs for each seed.

Nothing leaves the machine unless the environment has WANDB_MODE=online: `wandb sync` sends W&B's folders later, and
trackio's database lies with the files of the tracker, or in the folder that TRACKIO_DIR names.
"""

from __future__ import annotations

import contextvars
import importlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.tracking import films
from dextron_bench.tracking.training_files import Point, TrainingFiles

PROJECT = "dextron-bench"


class RunTracker:
    """Writes a run for each seed, grouped by method and source of reaches; the horizontal axis is the epoch."""

    def __init__(self, library: Any, files: TrainingFiles, into: Path, options: Mapping[str, Any]) -> None:
        """`options` are passed to the `init` of the library."""
        self._library, self._into = library, into
        self._has_steps = library.__name__ != "wandb"  # W&B refuses a step before the last; `epoch` is its axis.
        label, reaches = files.name.split("/")[:2]
        self._runs: dict[int, Any] = {}
        for seed in files.seeds:
            about = {"name": f"{label} {reaches} seed{seed}", "group": f"{label}/{reaches}"}
            about |= {"config": files.config() | {"seed": seed}, **options}
            run = contextvars.copy_context().run(library.init, **about)  # Trackio ends an earlier run of its context.
            if not self._has_steps:
                run.define_metric("*", step_metric="epoch")
            self._runs[seed] = run

    def point(self, point: Point) -> None:
        """Logs the values of an epoch or an evaluation."""
        self._log(point, point.values)

    def episodes(self, point: Point, episodes: Sequence[Episode]) -> None:
        """Logs a film of each episode."""
        videos = {}
        for row, episode in enumerate(episodes):
            file = self._into / f"episode-{point.epoch}-seed{point.seed}-{row}.gif"
            file.write_bytes(films.gif(episode))
            videos[f"val/episode{row}"] = self._library.Video(str(file), format="gif")
        self._log(point, videos)

    def flush(self) -> None:
        """Does nothing: the library writes by itself."""

    def close(self) -> None:
        """Ends the runs."""
        for run in self._runs.values():
            run.finish()

    def _log(self, point: Point, values: Mapping[str, Any]) -> None:
        if self._has_steps:
            self._runs[point.seed].log(dict(values), step=point.epoch)
        else:
            self._runs[point.seed].log({"epoch": point.epoch, **values})


def create(name: str, files: TrainingFiles, into: Path) -> RunTracker:
    """A tracker that writes into a folder with a library, "wandb" or "trackio"."""
    into.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("TRACKIO_DIR", str(into))  # Trackio reads it when it is loaded.
    library: Any = importlib.import_module(name)
    options = {"project": PROJECT, "embed": False, "auto_log_gpu": False, "auto_log_cpu": False}
    if name == "wandb":
        settings = library.Settings(silent=True, console="off")
        options = {"dir": str(into), "reinit": "create_new", "settings": settings}
        options["project"] = os.environ.get("WANDB_PROJECT", PROJECT)
        options["mode"] = os.environ.get("WANDB_MODE", "offline")
    return RunTracker(library, files, into, options)
