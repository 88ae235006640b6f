"""The training loop: epochs, checkpoints and the learning curve of a learner, for all seeds together.

If the process is killed, the same call continues from the last checkpoint and ends with the same bytes. Only
`timing.jsonl`, the durations of epochs, differs.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from dextron_bench.errors import DextronError, Failed
from dextron_bench.methods import loading, registry
from dextron_bench.methods.agents import AgentError, as_agent_error
from dextron_bench.methods.learners import Learner, Trainer, TrainingSetup
from dextron_bench.splits.loading import Split
from dextron_bench.storage import folder_config, hashing
from dextron_bench.storage.folders import visible
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.training import metric_rows, timing
from dextron_bench.training.checkpoints import Checkpoints, TrainingProgress
from dextron_bench.training.learning_curve import FINALISTS, Curve, CurvePoint
from dextron_bench.training.metric_rows import MetricRow
from dextron_bench.world import model

Watch = Callable[[dict[int, list[CurvePoint]]], None]  # Receives the learning curve of each seed.
NAME = re.compile(r"training-(\d+(?:\+\d+)*)", re.ASCII)  # Names of the folders in which seeds train.


class StoppedEarly(DextronError):
    """Raised by a `watch` to end a training before its last epoch; its checkpoint stays."""


def folder_of(base: Path, seeds: Sequence[int]) -> Path:
    """The folder in which seeds train together, below the folder of a method's runs on a source of reaches."""
    return base / f"training-{'+'.join(map(str, seeds))}"


def seeds_of(folder: Path) -> tuple[int, ...]:
    """The seeds in the name of a folder; none if `folder_of` does not name folders so."""
    match = NAME.fullmatch(folder.name)
    return tuple(map(int, match[1].split("+"))) if match else ()


def training_folders(base: Path, below: str = "") -> dict[Path, tuple[int, ...]]:
    """The folders that `folder_of` names, with their seeds; `below` is a pattern of folders between, as "*/*/"."""
    return {folder: seeds for folder in visible(base, f"{below}training-*") if (seeds := seeds_of(folder))}


def no_watch(curves: dict[int, list[CurvePoint]]) -> None:
    """A Watch that never stops a training."""


def train(
    learner: Learner,
    setup: TrainingSetup,
    seeds: Sequence[int],
    folder: Path,
    val: Split,
    report: Progress = no_progress,
    watch: Watch = no_watch,
) -> Checkpoints:
    """Trains, or continues to train, until all epochs are done and the best snapshot of each seed is known.

    `watch` is called when the learning curves have a new point. Raises what it raises, Failed, AgentError, Busy,
    BadInput, DamagedFile.
    """
    checkpoints = Checkpoints(folder, seeds)
    curve = Curve(learner, checkpoints, setup.source, val, setup.threads)
    with checkpoints.locked():
        folder_config.write_or_check(folder, config(learner, setup, seeds))
        progress = checkpoints.progress()
        if not progress or not progress.over:
            _TrainingRun(learner, setup, checkpoints, curve, report, watch).finish()
        checkpoints.finish()
        curve.score_snapshots()
        for seed in seeds:
            report(learner.epochs, learner.epochs, f"choosing between the {FINALISTS} best of seed {seed}")
            curve.best(seed)
    return checkpoints


def config(learner: Learner, setup: TrainingSetup, seeds: Sequence[int]) -> dict[str, Any]:
    """What a training depends on; a training with another config does not continue it."""
    return {
        "method": learner.name,
        "code": loading.class_origin(type(learner)),
        "settings": registry.settings_of(learner),
        "seeds": list(seeds),
        "cases": hashing.digest(repr(list(setup.cases)).encode()),
        "physics": model.mjcf_hash(),
    }


def seconds_per_epoch(learner: Learner, setup: TrainingSetup, seeds: Sequence[int]) -> float:
    """Duration of an epoch [s], measured on the last epoch of the learner's `timing_run`; writes no files of a run."""
    timing_run, duration = learner.timing_run, 0.0
    trainer = _trainer(timing_run, setup, seeds)
    while trainer.epoch < timing_run.epochs:
        start = time.perf_counter()
        with as_agent_error(f"epoch {trainer.epoch + 1} of method {timing_run.label!r}"):
            trainer.advance()
        duration = time.perf_counter() - start
    return duration


class _TrainingRun:
    """The epochs of a training that are not done yet."""

    def __init__(
        self,
        learner: Learner,
        setup: TrainingSetup,
        checkpoints: Checkpoints,
        curve: Curve,
        report: Progress,
        watch: Watch,
    ) -> None:
        self._learner, self._setup, self._checkpoints, self._curve = learner, setup, checkpoints, curve
        self._report, self._watch = report, watch

    def finish(self) -> None:
        """Trains to the last epoch, with a checkpoint and a point of the learning curve every period."""
        trainer = _trainer(self._learner, self._setup, self._checkpoints.seeds)
        self._checkpoints.resume(trainer, self._setup.device)
        epochs, period = self._learner.epochs, self._learner.period
        self._curve.score_snapshots()
        note = self._last_point()
        self._report(trainer.epoch, epochs, note)
        self._show_curves()
        while trainer.epoch < epochs:
            self._train_period(trainer, min((trainer.epoch // period + 1) * period, epochs), note)
            start = time.perf_counter()
            self._curve.score_snapshots()
            self._note_time("evaluation", trainer.epoch, time.perf_counter() - start)
            note = self._last_point()
            self._report(trainer.epoch, epochs, note)
            self._show_curves()

    def _train_period(self, trainer: Trainer, last: int, note: str) -> None:
        """Trains until an epoch, the last of a period, with its metrics after each epoch, and writes the checkpoint.

        `note` goes with the progress.
        """
        rows: list[MetricRow] = []
        while trainer.epoch < last:
            rows = self._epoch(trainer)
            metric_rows.append(self._checkpoints.folder, rows)
            self._report(trainer.epoch, self._learner.epochs, note)
        progress = TrainingProgress(last, self._learner.epochs, self._setup.device)
        self._checkpoints.save(trainer, progress, rows, self._about())

    def _epoch(self, trainer: Trainer) -> list[MetricRow]:
        """Trains one epoch; returns its metrics, a row for each seed."""
        number, start, seeds = trainer.epoch + 1, time.perf_counter(), self._checkpoints.seeds
        with as_agent_error(f"epoch {number} of method {self._learner.label!r}"):
            metrics = trainer.advance()
        count = len(metrics) if isinstance(metrics, Sequence) else repr(metrics)
        if trainer.epoch != number or count != len(seeds):
            raise AgentError(
                f"advance() of method {self._learner.label!r} must do one epoch and return a dictionary for each of "
                f"{len(seeds)} seeds; it went from epoch {number - 1} to {trainer.epoch} with {count}"
            )
        self._note_time("epoch", number, time.perf_counter() - start)
        rows = [
            MetricRow(number, seed, metric_rows.numbers(values, self._learner.label))
            for seed, values in zip(seeds, metrics, strict=True)
        ]
        for row in rows:
            if names := [name for name, value in row.metrics.items() if not math.isfinite(value)]:
                raise Failed(self._divergence(row, names[0]))
        return rows

    def _divergence(self, row: MetricRow, name: str) -> str:
        """The message for a metric that is not finite."""
        progress = self._checkpoints.progress()
        last = f"the last good checkpoint is at epoch {progress.epoch}" if progress else "there is no checkpoint yet"
        return (
            f"training of {self._learner.label!r} diverged: {name!r} of seed {row.seed} is {row.metrics[name]} in "
            f"epoch {row.epoch}; {last} in {self._checkpoints.folder}"
        )

    def _show_curves(self) -> None:
        """Gives the learning curves to `watch`, except those without points and finished ones."""
        epochs = self._checkpoints.epochs()
        if self._watch is not no_watch and epochs and epochs[-1] < self._learner.epochs:
            self._watch({seed: self._curve.points(seed) for seed in self._checkpoints.seeds})

    def _last_point(self) -> str:
        """The last point of the learning curve in words."""
        returns = self._curve.last_point()
        return "val " + " ".join(f"{value:.1f}" for value in returns.values()) if returns else ""

    def _about(self) -> dict[str, Any]:
        """What a file of weights says about itself."""
        learner = self._learner
        return {
            "method": learner.name,
            "label": learner.label,
            "settings": registry.settings_of(learner),
            "physics": model.mjcf_hash(),
        }

    def _note_time(self, activity: str, epoch: int, seconds: float) -> None:
        timing.append(self._checkpoints.folder, activity, epoch, seconds, self._setup.device)


def _trainer(learner: Learner, setup: TrainingSetup, seeds: Sequence[int]) -> Trainer:
    if learner.epochs < 1 or learner.period < 1:
        raise AgentError(
            f"method {learner.label!r} needs at least one epoch and a period of at least one; "
            f"it has {learner.epochs} and {learner.period}"
        )
    with as_agent_error(f"trainer() of method {learner.label!r}"):
        return learner.trainer(setup, seeds)
