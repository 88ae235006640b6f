"""What a run would do, and about how long it would take."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dextron_bench import lessons, records, splits, training
from dextron_bench.checkpoints import Checkpoints
from dextron_bench.run import Plan


def outlook(
    groups: Sequence[Sequence[Plan]], runs: Path, threads: int = 0, device: str = "cpu"
) -> list[dict[str, Any]]:
    """A row for each training and each evaluation that is not done, in their order; nothing of a run is written.

    `left` is in words, `seconds` an estimate from earlier epochs, else from one that is played, or None. Raises
    what `run.learn` does.
    """
    found: dict[str, dict[str, Any]] = {}
    for plans in groups:
        for plan in plans:
            records.check(plan.folder(runs), plan.config())
        if course := plans[0].course(runs, threads, device):
            for group in course.groups([plan.seed for plan in plans]):
                folder = course.folder(group)
                if str(folder) not in found:
                    found[str(folder)] = _training(course, group, folder)
        if left := sum(_episodes(plan, runs) for plan in plans):
            what = {"what": "evaluate", "left": f"{left} episodes", "seconds": None}
            found[str(plans[0].folder(runs))] = _row(plans[0].label, plans[0], [plan.seed for plan in plans]) | what
    return list(found.values())


def _training(course: lessons.Course, group: tuple[int, ...], folder: Path) -> dict[str, Any]:
    learner = course.learner
    progress = Checkpoints(folder, group).progress()
    left, epochs = (progress.epochs - progress.epoch, progress.epochs) if progress else (None, None)
    seconds = None if left is None else training.seconds_left(folder, left, learner.period)
    if left is None:
        epochs, first = training.measure(learner, course.track(), group)
        left, seconds = epochs, epochs * first
    return {
        "what": "train",
        "method": learner.label,
        "reaches": course.reaches,
        "seeds": list(group),
        "left": f"{left} of {epochs} epochs",
        "seconds": seconds,
    }


def _episodes(plan: Plan, runs: Path) -> int:
    """Episodes that are not in store."""
    wanted = [splits.load(plan.home, name) for name in plan.splits]
    done = records.stored(plan.folder(runs), wanted)
    counts = done["split"].value_counts().to_dict() if len(done) else {}
    return sum(len(split.cases) - counts.get(split.name, 0) for split in wanted)


def _row(label: str, plan: Plan, seeds: list[int]) -> dict[str, Any]:
    return {"what": "", "method": label, "reaches": plan.home, "seeds": seeds}
