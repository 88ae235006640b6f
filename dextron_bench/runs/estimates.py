"""What is left to do of runs, and about how long it takes."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.reaches import sources
from dextron_bench.runs import run_files
from dextron_bench.runs.plans import Run
from dextron_bench.splits.loading import load_split
from dextron_bench.storage import folder_config
from dextron_bench.training import loop, timing
from dextron_bench.training.checkpoints import Checkpoints
from dextron_bench.training.jobs import TrainingJob
from dextron_bench.training.learning_curve import POINT_ROWS

TIMED = 32  # Episodes that are played to measure the time of one.
SHORT = 5  # Epochs of a timing run at most; a longer one would take as long as the training.


@dataclass(frozen=True, slots=True)
class WorkLeft:
    """A training or an evaluation with work `left`, in words; `seconds` is an estimate, None if it is unknown."""

    what: Literal["train", "evaluate"]
    method: str
    reaches: str
    seeds: list[int]
    left: str
    seconds: float | None


def estimate(groups: Sequence[Sequence[Run]], runs: Path, threads: int = 0, device: str = "cpu") -> list[WorkLeft]:
    """A row for each training and each evaluation with work left, in their order; writes no files of a run.

    Runs of a group differ only in their seeds. `seconds` is estimated, for epochs from earlier
    epochs or a timing run, and for episodes from episodes that experts play. Raises the errors of `execution.train`.
    """
    rows: dict[str, WorkLeft] = {}
    for group in groups:
        for run in group:
            folder_config.check(run.folder(runs).path, run.config())
        if job := group[0].training_job(runs, threads, device):
            for seeds in job.groups([run.seed for run in group]):
                folder = job.training_folder(seeds)
                if str(folder) not in rows:
                    rows[str(folder)] = _training(job, seeds, folder)
        if episodes := sum(_missing_episodes(run, runs) for run in group):
            rows[str(group[0].folder(runs).path)] = _evaluation(group, episodes, threads)
    return list(rows.values())


@cache
def seconds_per_episode(reaches: str, threads: int) -> float:
    """Duration of an episode [s] on a source of reaches when many are played at once."""
    rows, source = load_split(reaches, "val").first(TIMED), sources.open_source(reaches)
    start = time.perf_counter()
    for _ in rollout(ExpertAgent(), source, rows, threads=threads):
        pass
    return (time.perf_counter() - start) / len(rows)


def _training(job: TrainingJob, seeds: tuple[int, ...], folder: Path) -> WorkLeft:
    """The row of a training; its time is unknown before the first epoch if its timing run is long."""
    learner = job.learner
    progress = Checkpoints(folder, seeds).progress()
    left = learner.epochs - (progress.epoch if progress else 0)
    seconds = timing.seconds_left(folder, left, learner.period)
    if seconds is None and learner.timing_run.epochs <= SHORT:
        rows = min(POINT_ROWS, len(load_split(job.reaches, "val"))) * math.ceil(left / learner.period)
        seconds = left * loop.seconds_per_epoch(learner, job.setup(), seeds)
        seconds += rows * len(seeds) * seconds_per_episode(job.reaches, job.threads)
    return WorkLeft("train", learner.label, job.reaches, list(seeds), f"{left} of {learner.epochs} epochs", seconds)


def _evaluation(group: Sequence[Run], episodes: int, threads: int) -> WorkLeft:
    """The row of an evaluation."""
    source, seeds = group[0].source, [run.seed for run in group]
    seconds = episodes * seconds_per_episode(source, threads)
    return WorkLeft("evaluate", group[0].label, source, seeds, f"{episodes} episodes", seconds)


def _missing_episodes(run: Run, runs: Path) -> int:
    """Number of episodes that the run's folder lacks."""
    splits = [load_split(run.source, name) for name in run.splits]
    table = run_files.stored_episodes(run.folder(runs), splits)
    counts = table["split"].value_counts().to_dict() if len(table) else {}
    return sum(len(split) - counts.get(split.name, 0) for split in splits)
