"""Leave-one-subject-out: a method learns without a subject of `train`, and plays that subject's settings.

A method that does not learn plays the same settings. No other split is played, except for the rows of `val` without the
subject, which choose the snapshot of a method that learns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods.learners import PolicyTransfer
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import Setting
from dextron_bench.runs import execution
from dextron_bench.runs.plans import Plan, Run, resolve
from dextron_bench.splits import strata
from dextron_bench.splits.loading import Split, load_split
from dextron_bench.splits.rows import Rows
from dextron_bench.storage import atomic, hashing, schemas
from dextron_bench.storage.run_folder import RunFolder, runs_without
from dextron_bench.sweeps.execution import Resources
from dextron_bench.training.jobs import TrainingJob

TRAIN = "train"


class NoCrossValidation(ValueError):
    """A method that cannot learn without a subject, or a source of reaches with one subject."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Scores (seeds, settings) on the settings of a subject, and how many episodes an agent failed."""

    subject: str
    scores: np.ndarray
    failed: int


def cross_validate(plan: Plan, seeds: Sequence[int], resources: Resources) -> Iterator[LeftOut]:
    """The scores of a method on each subject of `train`, sorted; what the folder of runs holds is not made again.

    Raises NoCrossValidation, the errors of `resolve` and of `TrainingJob.run`.
    """
    run = _checked(resolve(plan))
    split = load_split(run.source, TRAIN)
    subjects = sorted(set(strata.strata(split)["subject"]))
    if len(subjects) < 2:
        raise NoCrossValidation(f"the {run.source} reaches of {TRAIN} have one subject; none can be left out")
    for number, subject in enumerate(subjects, 1):
        with resources.bar(f"{run.label} without {subject}, {number} of {len(subjects)}") as report:
            job = None
            if run.learner is not None:
                job = TrainingJob(run.learner, run.source, resources.runs, resources.threads, resources.device, subject)
                job.run(seeds, report)
            held_out, _ = strata.by_subject(split, subject)
            entries = [_scores(run.with_seed(seed), subject, held_out, job, resources) for seed in seeds]
        scores = np.array([entry["scores"] for entry in entries], float)
        yield LeftOut(subject, scores, sum(entry["failed"] for entry in entries))


def _checked(run: Run) -> Run:
    if isinstance(run.method, PolicyTransfer):
        raise NoCrossValidation(
            f"{run.label} plays a policy that was trained on other reaches; it learns from no subject"
        )
    if run.source != run.plan.reaches:
        raise NoCrossValidation(f"{run.label} is always trained on {run.source} reaches; give --reaches {run.source}")
    return run


def _scores(run: Run, subject: str, held_out: Split, job: TrainingJob | None, resources: Resources) -> dict:
    """What the file of a seed holds: the scores on a subject's settings, played if the file is missing or stale."""
    folder = RunFolder.of(runs_without(resources.runs, subject), run.label, run.source, run.seed)
    weights = job.run_folder(run.seed).weights if job else None
    depends = {**run.config(), "rows": held_out.digest, "weights": hashing.sha256(weights) if weights else None}
    if folder.left_out.exists():
        stored = schemas.read(folder.left_out, schemas.LEFT_OUT)
        if stored["depends on"] == depends:
            return stored
    rows = _once(held_out)
    source, agent = sources.open_source(run.source), execution.agents(run, weights)()
    episodes = dict(rollout(agent, source, rows, threads=resources.threads))
    failed = sum(bool(episode.failure) for episode in episodes.values())
    content = {"depends on": depends, "scores": [episodes[row].score for row in range(len(rows))], "failed": failed}
    atomic.write_json(folder.left_out, content)
    return content


def _once(split: Split) -> Rows:
    """A row for each setting, the first one."""
    rows: dict[Setting, int] = {}
    for row, case in enumerate(split.cases):
        rows.setdefault(case.setting, row)
    return split.rows(rows.values())
