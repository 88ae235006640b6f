"""What a tracker offers, and a tracker by its name."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.tracking.training_files import Point, TrainingFiles

RUN_LIBRARIES = ("wandb", "trackio")  # Libraries with the interface of W&B.


class Tracker(Protocol):
    """Shows a training somewhere. Any of its methods may raise anything: the follower counts what is lost by that."""

    def point(self, point: Point) -> None:
        """Shows the values of an epoch, or of an evaluation."""
        ...

    def episodes(self, point: Point, episodes: Sequence[Episode]) -> None:
        """Shows a few episodes of an evaluation; `point` has its values."""
        ...

    def flush(self) -> None:
        """Called when all that the training has written so far was shown."""
        ...

    def close(self) -> None:
        """Completes what was written."""
        ...


def create(name: str, files: TrainingFiles, into: Path) -> Tracker:
    """A tracker that writes into a folder of its own, which is empty."""
    if name in RUN_LIBRARIES:
        from dextron_bench.tracking import to_wandb

        return to_wandb.create(name, files, into)
    module = importlib.import_module(f"dextron_bench.tracking.to_{name}")
    return module.create(files, into)
