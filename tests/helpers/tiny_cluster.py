"""Ray with several nodes on this machine, and workers that play the tiny benchmark."""

from __future__ import annotations

import importlib
import json
import os
import pickle
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dextron_bench.cluster import ray_cluster, worker
from dextron_bench.cluster.tasks import Reply, Task
from dextron_bench.experts import outcomes
from dextron_bench.runs import evaluation_job
from dextron_bench.storage import atomic
from tests.helpers import tiny_training

Blocks = Iterator[tuple[int, pd.DataFrame]]  # Numbers of blocks, and their draws.
ROOT = str(Path(__file__).parents[2])
DATA = "TINY_BENCHMARK"  # Names the folder with its splits.
failures: list[str] = []  # Why Ray itself does not start here; it is not tried again.


def perform(expected: Mapping[str, str | None], pickled: bytes, places: Mapping[str, str], *contents: bytes) -> Reply:
    """Does a task on the tiny benchmark."""
    install(Path(os.environ[DATA]))
    _wait_to_be_killed(pickle.loads(pickled))
    return worker.perform(expected, pickled, places, *contents)


def install(folder: Path, put: Callable[[object, str, object], None] = setattr) -> None:
    """Installs the tiny benchmark with training, cut into pieces of one row; searches play no simulation."""
    tiny_training.install(folder, put)
    put(evaluation_job, "ROWS", 1)
    put(outcomes, "play_blocks", quick_outcomes)


def measure(runs: Path, threads: int, place: str) -> Sequence[Path]:
    """Writes the length of an input into a file whose name is the input's first byte."""
    content = (runs / place).read_bytes()
    file = runs / "sizes" / str(content[0])
    file.parent.mkdir()
    file.write_text(str(len(content)))
    return [file]


def quick_outcomes(source: object, engine: object, drawn: Blocks, experts: int) -> Blocks:
    """Outcomes of draws that follow from d_c alone."""
    for number, draws in drawn:
        yield number, draws.assign(score=np.where(draws["critical"].between(0.2, 0.3), 20.0, 0.5), length=50)


@contextmanager
def started(folder: Path, monkeypatch: pytest.MonkeyPatch, nodes: int = 1, memory: int | None = None) -> Iterator[Any]:
    """A cluster whose head has no processors, and nodes with one each; commands reach it by `--cluster auto`.

    `memory` is the size of the object store of the head and of each node [bytes].
    """
    for name, value in ray_cluster.SETTINGS.items():
        os.environ.setdefault(name, value)  # Ray reads them when it is imported.
    pytest.importorskip("ray")
    utils = importlib.import_module("ray.cluster_utils")
    monkeypatch.setenv(DATA, str(folder))
    monkeypatch.setenv("PYTHONPATH", ROOT)
    monkeypatch.setattr(ray_cluster, "PERFORM", perform)
    stored = {"object_store_memory": memory} if memory else {}
    head = {"num_cpus": 0, "include_dashboard": False, **stored}
    if failures:
        pytest.skip(failures[0])
    try:
        cluster = utils.Cluster(initialize_head=True, head_node_args=head)
    except Exception as error:
        failures.append(f"Ray does not start on this machine: {error}")
        pytest.skip(failures[0])
    try:
        for _ in range(nodes):
            cluster.add_node(num_cpus=1, **stored)
        monkeypatch.setenv("RAY_ADDRESS", cluster.address)
        yield cluster
    finally:
        cluster.shutdown()


@contextmanager
def losing_a_node(cluster: Any, folder: Path, name: str, nth: int = 1) -> Iterator[list[bool]]:
    """Kills the node that gets the nth task whose name contains a text, while the task waits on it.

    Yields a list that has one entry when the node is killed.
    """
    folder = folder / "lost"
    folder.mkdir()
    (folder / "task.json").write_text(json.dumps({"name": name, "nth": nth}))
    lost: list[bool] = []
    ended = threading.Event()

    def kill() -> None:
        while not (file := folder / "node").exists():
            if ended.wait(0.1):
                return
        identity = file.read_text()
        cluster.remove_node(next(one for one in cluster.list_all_nodes() if one.node_id == identity), False)
        lost.append(True)

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    try:
        yield lost
    finally:
        ended.set()
        thread.join()


def _wait_to_be_killed(task: Task) -> None:
    """Waits if this is the task that shall lose its node, at its first try."""
    folder = Path(os.environ[DATA]).parent / "lost"
    if not folder.exists() or (folder / "node").exists():
        return
    wanted = json.loads((folder / "task.json").read_text())
    if wanted["name"] not in task.name:
        return
    with (folder / "tries").open("a") as file:
        file.write("x")
    if len((folder / "tries").read_text()) == wanted["nth"]:
        ray = importlib.import_module("ray")
        atomic.write_atomically(folder / "node", lambda part: part.write_text(ray.get_runtime_context().get_node_id()))
        time.sleep(600.0)
