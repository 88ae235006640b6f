"""A cluster without Ray: it does tasks in this process, as a node would, and can lose nodes."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path

from dextron_bench.cluster import installation, worker
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import Reply, Task, content_hash


def performed(task: Task, version: dict[str, str | None] | None = None) -> Reply:
    """What a node answers to a task."""
    contents = {place: file.read_bytes() for place, file in task.inputs.items()}
    hashes = {place: content_hash(content) for place, content in contents.items()}
    return worker.perform(version or installation.version(), pickle.dumps(task), hashes, *contents.values())


class ImmediateCluster(RayCluster):
    """Does tasks one after another. `losing` says by name how often a task loses its node; `order` has all tries."""

    def __init__(self, address: str, runs: Path, threads: int = 0) -> None:
        self.runs, self._under_way = runs, {}
        self.threads, self.losses, self.room = 1, 0, 2
        self.order: list[str] = []
        self.losing: dict[str, int] = {}

    def __enter__(self) -> ImmediateCluster:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is open."""

    def _room(self) -> int:
        return self.room

    def _submit(self, task: Task) -> None:
        self._under_way[task.name] = task

    def _cancel(self) -> None:
        self._under_way.clear()

    def _replies(self) -> Iterator[tuple[Task, Reply | None]]:
        task = self._under_way.pop(next(iter(self._under_way)))
        self.order.append(task.name)
        self.losing[task.name] = self.losing.get(task.name, 0) - 1
        yield task, None if self.losing[task.name] >= 0 else self._checked(task, performed(task))
