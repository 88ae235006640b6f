"""Trainings on a cluster: a task trains a group of seeds for some minutes, and the next one continues.

So a training needs no disk in common, and if its node is lost, it goes on from the files that the last task sent.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dextron_bench.cluster import inputs
from dextron_bench.cluster.pieces import check_expected
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import BadCluster, Task
from dextron_bench.methods import registry
from dextron_bench.runs import plans
from dextron_bench.storage import folder_config, provenance
from dextron_bench.storage.folders import visible
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.training import loop
from dextron_bench.training.checkpoints import CHECKPOINT, Checkpoints
from dextron_bench.training.jobs import TrainingJob

SECONDS = 300.0  # After this time, a task ends with its next checkpoint.


@dataclass(frozen=True, slots=True)
class Training:
    """Seeds that train together, as `run` plans them, in the folder of their job."""

    run: plans.Run
    job: TrainingJob
    seeds: tuple[int, ...]

    @property
    def checkpoints(self) -> Checkpoints:
        """Its files."""
        return Checkpoints(self.job.training_folder(self.seeds), self.seeds)

    @property
    def is_over(self) -> bool:
        """True if the best weights of every seed are there."""
        return all(self.job.run_folder(seed).weights.exists() for seed in self.seeds)

    @property
    def epoch(self) -> int:
        """The number of epochs that are done."""
        progress = self.checkpoints.progress()
        return progress.epoch if progress else 0

    def files(self) -> list[Path]:
        """All files that it has written, in an order in which another folder may get them: what completes it last."""
        folder, runs = self.checkpoints.folder, [self.job.run_folder(seed) for seed in self.seeds]
        parts = [file for file in visible(folder, "**/*") if file.is_file() and file != folder / CHECKPOINT]
        about = [file for run in runs for file in (run.config, run.provenance, run.times, run.curve)]
        files = [*parts, folder / CHECKPOINT, *about, *(run.weights for run in runs)]
        return [file for file in files if file.exists()]


def train(
    cluster: RayCluster,
    groups: Sequence[Sequence[plans.Run]],
    runs: Path,
    device: str = "cpu",
    progress: Progress = no_progress,
) -> None:
    """Trains what groups of runs need, groups that differ only in their seeds; skips seeds that are trained.

    `progress` receives epochs. Raises BadCluster, Busy, FolderMismatch and the errors of `RayCluster.run`.
    """
    if device == "auto":
        raise BadCluster("nodes may differ in their devices: give --device cpu or --device cuda, not auto")
    trainings = _trainings(groups, runs, cluster.threads, device)
    waiting, running = deque(trainings.items()), dict(trainings)
    total = sum(training.job.learner.epochs for training in trainings.values())

    def report() -> None:
        left = sum(one.job.learner.epochs - one.epoch for one in running.values())
        progress(total - left, total)

    def next_task(_: int) -> Task | None:
        return _task(*waiting.popleft(), runs, cluster.threads) if waiting else None

    def done(task: Task) -> bool:
        training = running[task.name]
        if training.is_over:
            training.checkpoints.finish()
            del running[task.name]
        else:
            waiting.append((task.name, training))
        report()
        return False

    with ExitStack() as locks:
        for training in trainings.values():
            locks.enter_context(training.checkpoints.locked())
        report()
        cluster.run(next_task, done)


def _trainings(groups: Sequence[Sequence[plans.Run]], runs: Path, threads: int, device: str) -> dict[str, Training]:
    """The trainings that are not over, by the name of their folder; several methods may need one training."""
    trainings = {}
    for group in groups:
        for run in group:
            folder_config.check(run.folder(runs).path, run.config())
        if (job := group[0].training_job(runs, threads, device)) is None:
            continue
        for seeds in job.groups([run.seed for run in group]):
            training = Training(group[0], job, seeds)
            trainings[training.checkpoints.folder.relative_to(runs).as_posix()] = training
    return trainings


def _task(name: str, training: Training, runs: Path, threads: int) -> Task:
    plan, files = plans.without_file(training.run.plan)
    files |= {file.relative_to(runs).as_posix(): file for file in training.files()}
    arguments: dict[str, Any] = {
        "plan": plan,
        "seeds": training.seeds,
        "device": training.job.device,
        "expected": _expected(training),
        "seconds": SECONDS,
    }
    gpus = int(training.job.device == "cuda")
    return Task(name, train_some, arguments, inputs.of(training.job.reaches, files), threads, gpus)


def train_some(
    runs: Path,
    threads: int,
    plan: plans.Plan,
    seeds: tuple[int, ...],
    device: str,
    expected: Mapping[str, Any],
    seconds: float,
) -> Sequence[Path]:
    """Trains until the first new checkpoint after some seconds, or to the end; returns all files of the training.

    Raises OtherVersion if the method differs from what is expected, and the errors of `TrainingJob.run`.
    """
    run = plans.resolve(plans.with_file(plan, runs))
    job = run.training_job(runs, threads, device)
    assert job is not None
    training, start = Training(run, job, seeds), time.monotonic()
    first = training.epoch
    check_expected(job.learner.label, _expected(training), expected)

    def watch(_: object) -> None:
        if training.epoch > first and time.monotonic() - start > seconds:
            raise loop.StoppedEarly

    with suppress(loop.StoppedEarly):
        job.run(seeds, watch=watch)
    return training.files()


def _expected(training: Training) -> dict[str, Any]:
    """What a training depends on, besides the installation."""
    learner, setup = training.job.learner, replace(training.job, device="cpu").setup()
    code = provenance.code_hash(*registry.package_files(type(learner)))
    return {"code of the method": code, **loop.config(learner, setup, training.seeds)}
