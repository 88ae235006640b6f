"""The evaluations of runs on a cluster: a task plays one piece, some rows of a split."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dextron_bench.cluster.inputs import imported_reaches, only_file
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import RUNS, OtherVersion, Task
from dextron_bench.methods import specs
from dextron_bench.runs import execution, plans
from dextron_bench.runs.evaluation_job import EvaluationJob, RowPiece
from dextron_bench.storage.progress import Progress, no_progress

WEIGHTS, ENTRANT = "weights", "entrant"  # Folders below a node's folder of runs: with the weights, and with the method.


def play(cluster: RayCluster, runs: Sequence[plans.Run], folder: Path, progress: Progress = no_progress) -> None:
    """Plays the pieces of runs that a folder of runs lacks; the trainings of the runs are done.

    `progress` receives pieces. Raises the errors of `execution.prepare`, `EvaluationJob.done` and `RayCluster.run`.
    """
    cluster.run_all([task for run in runs for task in tasks_of(run, folder, cluster.threads)], progress)


def tasks_of(run: plans.Run, folder: Path, threads: int) -> Iterator[Task]:
    """A task for each piece of a run that is not done."""
    job = execution.prepare(run, folder)
    inputs = imported_reaches(run.source)
    if weights := execution.weights_file(run, folder):
        inputs[f"{RUNS}/{WEIGHTS}/{weights.name}"] = weights
    plan, files = without_file(run.plan)
    arguments = {"plan": replace(plan, weights=None), "label": run.label}
    for piece in undone(job):
        yield Task(
            f"{job.folder.identity}/{piece.name}",
            play_piece,
            arguments | {"piece": piece.name, "expected": expected(job, piece)},
            inputs | files,
            threads,
        )


def play_piece(
    runs: Path, threads: int, plan: plans.Plan, label: str, piece: str, expected: Mapping[str, Any]
) -> Sequence[Path]:
    """Plays a piece of a run; returns its files. Raises OtherVersion if it depends on other things than expected."""
    run = replace(plans.resolve(with_file(plan, runs)), label=label)
    weights = only_file(runs / WEIGHTS)
    run = run.with_weights(plan.seed, weights) if weights else run
    return play_expected(execution.prepare(run, runs, threads), piece, expected)


def undone(job: EvaluationJob) -> list[RowPiece]:
    """The pieces of an evaluation that its folder lacks."""
    done = job.done()
    return [piece for piece in job.pieces() if piece.name not in done]


def expected(job: EvaluationJob, piece: RowPiece) -> dict[str, Any]:
    """Everything that a piece depends on."""
    return {"code of the method": job.code, **job.config_of(piece)}


def play_expected(job: EvaluationJob, name: str, wanted: Mapping[str, Any]) -> Sequence[Path]:
    """Plays the piece with a name; returns its files. Raises OtherVersion if it depends on other things than wanted."""
    piece = next(piece for piece in job.pieces() if piece.name == name)
    check_expected(job.folder.identity, expected(job, piece), wanted)
    return job.play_piece(piece)


def check_expected(what: str, here: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Raises OtherVersion if something depends on other things on this node than where the command runs."""
    if differing := [name for name in wanted if here.get(name) != wanted[name]]:
        raise OtherVersion(
            f"a node has another version of {what}: it differs in {' and '.join(differing)}; install the same on all "
            "nodes"
        )


def without_file(plan: plans.Plan) -> tuple[plans.Plan, dict[str, Path]]:
    """The plan, with only the name of the file that its method lies in, if any, and this file as an input."""
    spec = specs.parse(plan.method)
    if spec.file is None:
        return plan, {}
    return replace(plan, method=str(replace(spec, location=spec.file.name))), {
        f"{RUNS}/{ENTRANT}/{spec.file.name}": spec.file
    }


def with_file(plan: plans.Plan, runs: Path) -> plans.Plan:
    """The plan with its method's file on this node; undoes `without_file`."""
    spec = specs.parse(plan.method)
    if spec.file is None:
        return plan
    return replace(plan, method=str(replace(spec, location=str(runs / ENTRANT / spec.file))))
