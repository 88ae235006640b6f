"""The trials of a sweep on a cluster, side by side. A trial that fails is left out, and the others go on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from dextron_bench.cluster import pieces, trainings
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import PieceFailed, Task
from dextron_bench.methods.agents import AgentError
from dextron_bench.runs import execution
from dextron_bench.runs.plans import Run
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import source_folder

Groups = Sequence[Sequence[Run]]  # The runs of each trial, one for each seed.


def train(
    cluster: RayCluster, groups: Groups, runs: Path, device: str = "cpu", progress: Progress = no_progress
) -> Groups:
    """Trains what the trials need; returns those whose training did not fail. Raises the errors of `trainings.train`.

    `progress` receives epochs.
    """
    return _without_failures(
        groups,
        lambda left: trainings.train(cluster, left, runs, device, progress),
        lambda group: _training_folder(group, runs),
    )


def play(cluster: RayCluster, groups: Groups, runs: Path, progress: Progress = no_progress) -> Groups:
    """Plays what the trials lack; returns those that did not fail. Raises the errors of `RayCluster.run`.

    `progress` receives pieces.
    """

    def play_all(left: Groups) -> None:
        cluster.run_all([task for group in left for task in _tasks(cluster, group, runs)], progress)

    return _without_failures(groups, play_all, lambda group: group[0].folder(runs).path.parent.relative_to(runs))


def _without_failures(groups: Groups, work: Callable[[Groups], None], place: Callable[[Sequence[Run]], Path]) -> Groups:
    """Does work on groups, again without a group whose task fails; returns the others.

    The name of a task begins with the `place` of its group. Raises PieceFailed if it is of no group.
    """
    while groups:
        try:
            work(groups)
            break
        except PieceFailed as error:
            left = [group for group in groups if not Path(error.task).is_relative_to(place(group))]
            if len(left) == len(groups):
                raise
            groups = left
    return groups


def _training_folder(group: Sequence[Run], runs: Path) -> Path:
    """The folder of the trainings of a group, which may be of another method, below the folder of runs."""
    job = group[0].training_job(runs)
    folder = source_folder(runs, job.learner.label, job.reaches) if job else group[0].folder(runs).path.parent
    return folder.relative_to(runs)


def _tasks(cluster: RayCluster, group: Sequence[Run], runs: Path) -> list[Task]:
    """The tasks of a trial; none if its agent cannot be made, which the sweep finds out and writes down."""
    try:
        return [task for run in group for task in pieces.tasks_of(cluster, execution.prepare(run, runs))]
    except AgentError:
        return []
