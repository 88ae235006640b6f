"""Pieces of any work as tasks on a cluster."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dextron_bench.cluster import inputs
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import OtherVersion, Task
from dextron_bench.storage import block_work
from dextron_bench.storage.block_work import BlockWork
from dextron_bench.storage.pieces import CODE, ListedWork, Place, Recipe, Work
from dextron_bench.storage.progress import Progress, no_progress


def play(cluster: RayCluster, works: Sequence[ListedWork], progress: Progress = no_progress) -> None:
    """Plays the pieces that works lack, below the cluster's folder of runs; `progress` receives pieces.

    Raises the errors of `ListedWork.done` and of `RayCluster.run`.
    """
    cluster.run_all([task for work in works for task in tasks_of(cluster, work)], progress)


def tasks_of(cluster: RayCluster, work: ListedWork) -> list[Task]:
    """A task for each piece of a work that is not done."""
    done = work.done()
    return [_task(cluster, work, name) for name in work.names() if name not in done]


def play_blocks(cluster: RayCluster, work: BlockWork, progress: Progress = no_progress) -> None:
    """Plays blocks as pieces until they reach the goal of a work, below the cluster's folder of runs.

    At the end, a few blocks more than needed may be there, as with shares; the blocks under way then are cancelled.
    `progress` receives units of the goal. Raises the errors of `BlockWork.play_share` and of `RayCluster.run`.
    """
    work.begin()
    work.stored()  # Checks them.
    submitted = set(work.amounts())

    def next_task(under_way: int) -> Task | None:
        number = next(number for number in range(len(submitted) + 1) if number not in submitted)
        if under_way and number >= block_work.blocks_needed(list(work.amounts().values()), work.goal):
            return None
        submitted.add(number)
        return _task(cluster, work, block_work.name_of(number))

    def is_enough(_: Task | None = None) -> bool:
        amounts = work.amounts()
        progress(int(min(sum(amounts.values()), work.goal)), work.goal)
        return block_work.last_needed(amounts, work.goal) is not None

    if not is_enough():
        cluster.run(next_task, is_enough)


def play_piece(
    runs: Path, threads: int, recipe: Recipe, folder: str, name: str, expected: Mapping[str, Any]
) -> list[Path]:
    """Plays a piece on a node; returns its files. Raises OtherVersion if it depends on other things than expected."""
    work = recipe.make(Place(runs, runs / folder, threads), **recipe.arguments)
    check_expected(work.title(name), _depends_on(work, name), expected)
    return work.play(name)


def check_expected(what: str, here: Mapping[str, Any], expected: Mapping[str, Any]) -> None:
    """Raises OtherVersion if something depends on other things on this node than where the command runs."""
    if differing := [name for name in expected if here.get(name) != expected[name]]:
        raise OtherVersion(
            f"a node has another version of {what}: it differs in {' and '.join(differing)}; install the same on all "
            "nodes"
        )


def _task(cluster: RayCluster, work: Work, name: str) -> Task:
    recipe = work.recipe(name)
    arguments = {
        "recipe": replace(recipe, files={}),
        "folder": work.place.relative_to(cluster.runs).as_posix(),
        "name": name,
        "expected": _depends_on(work, name),
    }
    return Task(work.title(name), play_piece, arguments, inputs.of(recipe.reaches, recipe.files), cluster.threads)


def _depends_on(work: Work, name: str) -> dict[str, Any]:
    """Everything that a piece depends on."""
    return {CODE: work.code, **(work.config_of(name) or {})}
