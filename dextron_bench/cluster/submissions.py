"""The episodes of a submission on a cluster: a task plays one piece, with the agent in a process of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dextron_bench.cluster import evaluations
from dextron_bench.cluster.evaluations import ENTRANT
from dextron_bench.cluster.inputs import imported_reaches
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import RUNS, BadCluster, Task
from dextron_bench.methods import specs
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.submissions import playing
from dextron_bench.submissions.entry import Entry


def play(
    cluster: RayCluster, entry: Entry, runs: Path, record: int, limits: Limits, progress: Progress = no_progress
) -> None:
    """Plays the pieces of an entry that the folder of runs lacks; `progress` receives pieces.

    Raises BadCluster for a program, which lies on this machine alone, and the errors of `playing.prepare_all`,
    `EvaluationJob.done` and `RayCluster.run`.
    """
    if specs.parse(entry.spec).kind == "command":
        raise BadCluster(f"{entry.spec} lies on this machine alone: use --share on machines that have it")
    cluster.run_all(list(_tasks(entry, runs, record, limits, cluster.threads)), progress)


def _tasks(entry: Entry, runs: Path, record: int, limits: Limits, threads: int) -> Iterator[Task]:
    files = {f"{RUNS}/{ENTRANT}/{name}": file for name, file in entry.files().items()}
    inputs = files | imported_reaches(entry.reaches)
    for job in playing.prepare_all(entry, runs, record, limits):
        for piece in evaluations.undone(job):
            arguments: dict[str, Any] = {
                "entry": _without_folders(entry),
                "record": record,
                "limits": limits,
                "seed": job.folder.seed,
                "piece": piece.name,
                "expected": evaluations.expected(job, piece),
            }
            yield Task(f"{job.folder.identity}/{piece.name}", play_piece, arguments, inputs, threads)


def play_piece(
    runs: Path,
    threads: int,
    entry: Entry,
    record: int,
    limits: Limits,
    seed: int,
    piece: str,
    expected: Mapping[str, Any],
) -> Sequence[Path]:
    """Plays a piece of an entry; returns its files. Raises OtherVersion if it depends on other things than expected."""
    jobs = playing.prepare_all(_in_folder(entry, runs / ENTRANT), runs, record, limits, threads)
    job = next(job for job in jobs if job.folder.seed == seed)
    return evaluations.play_expected(job, piece, expected)


def _without_folders(entry: Entry) -> Entry:
    """The entry, with only the names of its files."""
    return _in_folder(entry, Path())


def _in_folder(entry: Entry, folder: Path) -> Entry:
    """The entry, with its files in a folder."""
    spec = specs.parse(entry.spec)
    if spec.file is not None:
        spec = replace(spec, location=str(folder / spec.file.name))
    weights = folder / entry.weights.name if entry.weights else None
    return replace(entry, spec=str(spec), weights=weights)
