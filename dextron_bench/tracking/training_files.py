"""Reads what a training has newly written: metrics, durations, and evaluations on `val`.

The training may run in another process at the same time. Nothing is written to its folder.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.errors import BadInput
from dextron_bench.storage import records
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.folders import visible
from dextron_bench.storage.run_folder import SEED
from dextron_bench.training import loop, metric_rows, timing
from dextron_bench.training.checkpoints import Checkpoints
from dextron_bench.training.learning_curve import ValScores
from dextron_bench.training.metric_rows import METRICS
from dextron_bench.training.timing import Duration
from dextron_bench.world import task

CHUNK = 1 << 20  # Bytes of a file that are read at once.
NOMINAL_STEPS = 1000  # Control steps that an epoch counts as, if a learner does not report `frames`.


@dataclass(frozen=True, slots=True)
class Point:
    """Values by name of one epoch and seed; `step` is the number of control steps of the training so far."""

    epoch: int
    seed: int
    step: int
    values: dict[str, float]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The snapshot of a seed evaluated on `val`: scores of the first rows, and actions (T,) of a few of these."""

    point: Point
    digest: str
    actions: list[np.ndarray]


def training_folders(place: Path) -> dict[Path, tuple[int, ...]]:
    """The folders of trainings at, beside or below a place, with their seeds; raises BadInput.

    A place is a folder of runs, of a method, of a source of reaches, of a seed, or of a training.
    """
    place = place.resolve()
    seed = place.name.removeprefix(SEED)
    folders: dict[Path, tuple[int, ...]] = {}
    if loop.seeds_of(place) or (place.name.startswith(SEED) and seed.isdecimal()):
        siblings = loop.training_folders(place.parent)
        folders = {folder: seeds for folder, seeds in siblings.items() if folder == place or seed in map(str, seeds)}
    for below in ("", "*/", "*/*/"):
        folders |= loop.training_folders(place, below)
    if not folders:
        raise BadInput(
            f"{place} holds no training; give a folder in which `dextron-bench run` trains, such as runs/rlil-0.1"
        )
    return folders


class TrainingFiles:
    """The files of one training; each call returns what is new since the last call."""

    def __init__(self, folder: Path, seeds: Sequence[int]) -> None:
        self.folder, self.seeds = folder, tuple(seeds)
        self._checkpoints = Checkpoints(folder, seeds)
        self._metrics, self._timing = _Lines(folder / METRICS), _Lines(folder / timing.FILE)
        self._durations: dict[int, Duration] = {}  # Rows of `timing.jsonl` by epoch.
        self._last: dict[int, tuple[int, int]] = {}  # The newest epoch of each seed, and its step.
        self._steps: dict[tuple[int, int], int] = {}  # Steps by epoch and seed.
        self._evaluated: set[tuple[int, int]] = set()

    @property
    def name(self) -> str:
        """The label of the method, the source of reaches and the seeds."""
        return "/".join((*self.folder.parts[-3:-1], self.folder.name.removeprefix("training-")))

    @property
    def reaches(self) -> str:
        """The source of reaches that the learner trains on."""
        return self.folder.parent.name

    @property
    def is_over(self) -> bool:
        """True if no process is training here."""
        return not self._checkpoints.is_locked

    def config(self) -> dict[str, Any]:
        """The config of the training; empty if there is none yet."""
        file = self.folder / "config.json"
        return records.read(file, dict[str, Any]) if file.exists() else {}

    def points(self) -> list[Point]:
        """New values of epochs: metrics under `train/`, rates and memory. An epoch counts once, though it may return.

        An epoch returns when the training was interrupted after it and before a checkpoint.
        """
        self._read_durations()
        points = []
        for row in filter(None, metric_rows.parse(self._metrics.new())):
            epoch, seed = row.epoch, row.seed
            before, step_before = self._last.get(seed, (0, 0))
            if epoch > before:
                step = int(row.metrics.get("frames", epoch * NOMINAL_STEPS))
                self._last[seed], self._steps[epoch, seed] = (epoch, step), step
                values = {f"train/{name}": value for name, value in row.metrics.items()}
                points.append(Point(epoch, seed, step, values | self._rates(epoch, step - step_before)))
        return points

    def evaluations(self) -> list[Evaluation]:
        """New evaluations, in the order of their epochs; one that cannot be read is left out."""
        folders = visible(self.folder / "weights", "epoch-*")
        epochs = sorted(int(name) for folder in folders if (name := folder.name.removeprefix("epoch-")).isdecimal())
        new = [(epoch, seed) for epoch in epochs for seed in self.seeds if (epoch, seed) not in self._evaluated]
        return [evaluation for epoch, seed in new for evaluation in self._evaluation(epoch, seed)]

    def _evaluation(self, epoch: int, seed: int) -> Iterator[Evaluation]:
        """The evaluation with the fewest rows, which is a point of the learning curve."""
        snapshot = self._checkpoints.snapshot(epoch, seed)
        rows = {file.stem.rpartition("-val")[2]: file for file in visible(snapshot.parent, f"seed{seed}-val*.json")}
        files = {int(count): file for count, file in rows.items() if count.isdecimal()}
        if not files:
            return
        self._evaluated.add((epoch, seed))
        try:
            content = records.read(files[min(files)], ValScores)
        except (DamagedFile, OSError):
            return
        scores = content.scores
        success = sum(score == task.SUCCESS for score in scores) / len(scores)
        values = {"val/return": sum(scores) / len(scores), "val/success": success}
        step = self._steps.get((epoch, seed), epoch * NOMINAL_STEPS)
        actions = [np.array(sequence) for sequence in content.actions]
        yield Evaluation(Point(epoch, seed, step, values), content.digest, actions)

    def _read_durations(self) -> None:
        for row in records.rows(self._timing.new(), Duration):
            if row and row.what == "epoch" and row.epoch is not None:
                self._durations[row.epoch] = row

    def _rates(self, epoch: int, steps: int) -> dict[str, float]:
        """Duration of an epoch [s], control steps of a seed per second, and memory [MB], as far as they are known."""
        row = self._durations.get(epoch)
        if row is None:
            return {}
        rates = {"time/seconds_per_epoch": row.seconds}
        if row.seconds:
            rates["time/steps_per_second"] = steps / row.seconds
        memory = {"memory/process_MB": row.memory, "memory/device_MB": row.device_memory}
        return rates | {name: amount for name, amount in memory.items() if amount is not None}


class _Lines:
    """The lines of a file that grows; it may also be cut and written again, as an interrupted training does."""

    def __init__(self, file: Path) -> None:
        self._file, self._offset = file, 0

    def new(self) -> bytes:
        """Whole lines after those that were read, at most CHUNK bytes; all again if the file was cut."""
        try:
            with self._file.open("rb") as content:
                if content.seek(0, 2) < self._offset:
                    self._offset = 0
                content.seek(self._offset)
                whole = content.read(CHUNK).rpartition(b"\n")
        except OSError:
            return b""
        lines = b"".join(whole[:2])
        self._offset += len(lines)
        return lines
