"""Training: epochs, checkpoints and the learning curve of a learner, for all seeds together.

Killed at any moment, the same call goes on from the last checkpoint and ends with the same bytes, but for
`timing.jsonl`, which says how long epochs took.
"""

from __future__ import annotations

import json
import math
import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from dextron_bench.methods import loading, registry
from dextron_bench.methods.agents import AgentError, as_agent_error
from dextron_bench.methods.learners import Learner, Track, Trainer
from dextron_bench.runs import run_files
from dextron_bench.splits.loading import Split
from dextron_bench.storage import hashing
from dextron_bench.training.checkpoints import Checkpoints, Progress
from dextron_bench.training.learning_curve import FINALISTS, Curve
from dextron_bench.training.timing import TIMING
from dextron_bench.world import model

NAME = re.compile(r"training-(\d+(?:\+\d+)*)", re.ASCII)  # Of the folders in which seeds train.

Report = Callable[[int, int, str], None]  # Told (epochs done, epochs in all, how it goes).


class Diverged(ArithmeticError):
    """A training whose numbers are no longer finite."""


def quiet(done: int, total: int, note: str) -> None:
    """Reports nothing."""


def folder_of(base: Path, seeds: Sequence[int]) -> Path:
    """Where seeds train together, below the folder of a method's runs on a source of reaches."""
    return base / f"training-{'+'.join(map(str, seeds))}"


def groups(base: Path, below: str = "") -> dict[Path, tuple[int, ...]]:
    """The folders that `folder_of` named, and the seeds that train there; `below` leads to theirs, as "*/*/"."""
    found = {place: NAME.fullmatch(place.name) for place in sorted(base.glob(f"{below}training-*"))}
    return {place: tuple(map(int, told[1].split("+"))) for place, told in found.items() if told}


def train(
    learner: Learner, track: Track, seeds: Sequence[int], folder: Path, val: Split, report: Report = quiet
) -> Checkpoints:
    """Trains, or goes on training, until all epochs are done and the best snapshot of each seed is known.

    Raises Diverged, AgentError, Busy, FolderMismatch, DamagedFile.
    """
    done = Checkpoints(folder, seeds)
    curve = Curve(learner, done, track.source, val, track.threads)
    with done.locked():
        run_files.claim(folder, config(learner, track, seeds))
        found = done.progress()
        if not found or not found.over:
            _TrainingRun(learner, track, done, curve, report).finish()
        done.finish()
        curve.extend()
        for seed in seeds:
            report(learner.epochs, learner.epochs, f"choosing between the {FINALISTS} best of seed {seed}")
            curve.best(seed)
    return done


def config(learner: Learner, track: Track, seeds: Sequence[int]) -> dict[str, Any]:
    """What a training depends on; another is not its continuation."""
    return {
        "method": learner.name,
        "code": loading.origin(type(learner)),
        "settings": registry.settings(learner),
        "seeds": list(seeds),
        "cases": hashing.digest(repr(list(track.cases)).encode()),
        "physics": model.mjcf_hash(),
    }


def measure(learner: Learner, track: Track, seeds: Sequence[int]) -> float:
    """How long an epoch takes [s], from the last of the learner's timing_run; writes no files of a run."""
    timing_run = learner.timing_run
    trainer, took = _begin(timing_run, track, seeds), 0.0
    while trainer.epoch < timing_run.epochs:
        began = time.perf_counter()
        with as_agent_error(f"epoch {trainer.epoch + 1} of method {timing_run.label!r}"):
            trainer.advance()
        took = time.perf_counter() - began
    return took


class _TrainingRun:
    """What is left of a training."""

    def __init__(self, learner: Learner, track: Track, done: Checkpoints, curve: Curve, report: Report) -> None:
        self._learner, self._track, self._done, self._curve, self._report = learner, track, done, curve, report

    def finish(self) -> None:
        """Does all epochs that are not done."""
        trainer = _begin(self._learner, self._track, self._done.seeds)
        self._done.resume(trainer, self._track.device)
        note = self._note()
        epochs, period = self._learner.epochs, self._learner.period
        self._report(trainer.epoch, epochs, note)
        while trainer.epoch < epochs:
            last = min((trainer.epoch // period + 1) * period, epochs)
            rows: list[dict[str, Any]] = []
            while trainer.epoch < last:
                rows += self._epoch(trainer)
                self._report(trainer.epoch, epochs, note)
            self._done.save(trainer, Progress(last, epochs, self._track.device), rows, self._about())
            began = time.perf_counter()
            note = self._note()
            self._time("evaluation", trainer.epoch, time.perf_counter() - began)
            self._report(trainer.epoch, epochs, note)

    def _epoch(self, trainer: Trainer) -> list[dict[str, Any]]:
        """One epoch's metrics, a row for each seed."""
        number, began = trainer.epoch + 1, time.perf_counter()
        with as_agent_error(f"epoch {number} of method {self._learner.label!r}"):
            noted = trainer.advance()
        if trainer.epoch != number or len(noted) != len(self._done.seeds):
            raise AgentError(
                f"advance() of method {self._learner.label!r} must do one epoch and return a dictionary for each of "
                f"{len(self._done.seeds)} seeds; it went from epoch {number - 1} to {trainer.epoch} with {len(noted)}"
            )
        self._time("epoch", number, time.perf_counter() - began)
        rows = [
            {"epoch": number, "seed": seed, **{name: float(value) for name, value in each.items()}}
            for seed, each in zip(self._done.seeds, noted, strict=True)
        ]
        for row in rows:
            if lost := [name for name, value in row.items() if not math.isfinite(value)]:
                raise Diverged(self._farewell(row, lost[0]))
        return rows

    def _farewell(self, row: dict[str, Any], name: str) -> str:
        found = self._done.progress()
        last = f"the last good checkpoint is that of epoch {found.epoch}" if found else "there is no checkpoint yet"
        return (
            f"training of {self._learner.label!r} diverged: {name!r} of seed {row['seed']} is {row[name]} in epoch "
            f"{row['epoch']}; {last} in {self._done.folder}"
        )

    def _note(self) -> str:
        """Extends the learning curve; its last point in words."""
        last = self._curve.extend()
        return "val " + " ".join(f"{value:.1f}" for value in last.values()) if last else ""

    def _about(self) -> dict[str, Any]:
        """What goes with weights."""
        learner = self._learner
        return {
            "method": learner.name,
            "label": learner.label,
            "settings": registry.settings(learner),
            "physics": model.mjcf_hash(),
        }

    def _time(self, what: str, epoch: int, seconds: float) -> None:
        with (self._done.folder / TIMING).open("a", encoding="utf-8") as file:
            row = {"what": what, "epoch": epoch, "seconds": round(seconds, 4), "device": self._track.device}
            file.write(json.dumps(row) + "\n")


def _begin(learner: Learner, track: Track, seeds: Sequence[int]) -> Trainer:
    if learner.epochs < 1 or learner.period < 1:
        raise AgentError(
            f"method {learner.label!r} needs at least one epoch and a period of at least one; "
            f"it has {learner.epochs} and {learner.period}"
        )
    with as_agent_error(f"trainer() of method {learner.label!r}"):
        return learner.trainer(track, seeds)
