"""What a run would do, and about how long it would take."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.reaches import sources
from dextron_bench.runs import run_files
from dextron_bench.runs.plans import Plan
from dextron_bench.splits.loading import load_split
from dextron_bench.training import jobs, loop, timing
from dextron_bench.training.checkpoints import Checkpoints
from dextron_bench.training.learning_curve import CURVE

PLAYED = 32  # Episodes from which the time of others is foretold.


def estimate(
    groups: Sequence[Sequence[Plan]], runs: Path, threads: int = 0, device: str = "cpu"
) -> list[dict[str, Any]]:
    """A row for each training and each evaluation that is not done, in their order; nothing of a run is written.

    `left` is in words, `seconds` an estimate: of epochs from earlier ones, else from a timing_run; of episodes from
    some that their experts play. Raises what `run.learn` does.
    """
    found: dict[str, dict[str, Any]] = {}
    for plans in groups:
        for plan in plans:
            run_files.check(plan.folder(runs), plan.config())
        if course := plans[0].course(runs, threads, device):
            for group in course.groups([plan.seed for plan in plans]):
                folder = course.folder(group)
                if str(folder) not in found:
                    found[str(folder)] = _training(course, group, folder)
        if left := sum(_episodes(plan, runs) for plan in plans):
            found[str(plans[0].folder(runs))] = {
                "what": "evaluate",
                "method": plans[0].label,
                "reaches": plans[0].source,
                "seeds": [plan.seed for plan in plans],
                "left": f"{left} episodes",
                "seconds": left * seconds_per_episode(plans[0].source, threads),
            }
    return list(found.values())


@cache
def seconds_per_episode(reaches: str, threads: int) -> float:
    """About how long an episode takes [s] when many are played at once, on a source of reaches."""
    cases = load_split(reaches, "val").cases[:PLAYED]
    source = sources.open_source(reaches)
    began = time.perf_counter()
    for _ in rollout(ExpertAgent(), source, cases, threads=threads):
        pass
    return (time.perf_counter() - began) / len(cases)


def _training(course: jobs.TrainingJob, group: tuple[int, ...], folder: Path) -> dict[str, Any]:
    learner = course.learner
    progress = Checkpoints(folder, group).progress()
    left = learner.epochs - (progress.epoch if progress else 0)
    seconds = timing.seconds_left(folder, left, learner.period)
    if seconds is None:
        points = min(CURVE, len(load_split(course.reaches, "val").cases)) * math.ceil(left / learner.period)
        seconds = left * loop.measure(learner, course.track(), group)
        seconds += points * len(group) * seconds_per_episode(course.reaches, course.threads)
    return {
        "what": "train",
        "method": learner.label,
        "reaches": course.reaches,
        "seeds": list(group),
        "left": f"{left} of {learner.epochs} epochs",
        "seconds": seconds,
    }


def _episodes(plan: Plan, runs: Path) -> int:
    """Episodes that are not in store."""
    wanted = [load_split(plan.source, name) for name in plan.splits]
    done = run_files.stored(plan.folder(runs), wanted)
    counts = done["split"].value_counts().to_dict() if len(done) else {}
    return sum(len(split.cases) - counts.get(split.name, 0) for split in wanted)
