"""Commands on a real Ray with several nodes: the same bytes, lost nodes, failures of the work, a full object store."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from dextron_bench.cli import main
from dextron_bench.cluster import trainings
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import Task
from dextron_bench.experts import montecarlo
from tests.cli.test_shares import contents
from tests.helpers import tiny_benchmark, tiny_cluster, tiny_training
from tests.helpers.tiny_runs import constant_agent
from tests.helpers.tiny_training import TOY

pytestmark = pytest.mark.slow
RUN = ("run", "--method", "exp", "--quiet", "--threads", "1")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty working folder with the tiny benchmark, cut into pieces of one row, and small blocks of searches."""
    tiny_cluster.install(tiny_training.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.setattr(montecarlo.Search.__init__, "__defaults__", ("synthetic", 0, 3, 4))
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    tiny_benchmark.forget()


def play(*words: str | Path) -> None:
    assert main.main([*map(str, words)]) == 0


def test_the_bytes_are_the_same_without_a_cluster_and_on_one_and_three_nodes(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    search = ("data", "mc", "--rows", "2", "--quiet", "--threads", "1")
    play(*RUN, "--runs", "whole")
    play(*search, "--runs", "whole")
    files, printed = contents(here / "whole"), capsys.readouterr().out
    with tiny_cluster.started(here / "data", monkeypatch) as cluster:
        for runs, nodes in (("one", 1), ("three", 3)):
            while len(cluster.worker_nodes) < nodes:
                cluster.add_node(num_cpus=1)
            play(*RUN, "--runs", runs, "--cluster", "auto")
            play(*search, "--runs", runs, "--cluster", "auto")
            more = {name: content for name, content in contents(here / runs).items() if name in files}
            assert more == files
            assert capsys.readouterr().out == printed.replace("whole", runs)


def test_pieces_of_a_lost_node_are_played_again(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    play(*RUN, "--runs", "whole")
    with (
        tiny_cluster.started(here / "data", monkeypatch, nodes=2) as cluster,
        tiny_cluster.losing_a_node(cluster, here, "test-0001-0001") as lost,
    ):
        play(*RUN, "--cluster", "auto")
    assert lost == [True]
    assert contents(here / "runs") == contents(here / "whole")
    assert "pieces done again because their node was lost: 1" in capsys.readouterr().err


@pytest.mark.thorough
def test_a_training_and_a_search_go_on_when_their_nodes_are_lost(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """The training loses the node of its third task, which goes on from the checkpoint of the second.

    The search loses the node of its first block, which is all that it needs.
    """
    training = (*RUN[:2], TOY, *RUN[3:], "--preset", "quick", "--split", "val", "--seed", "0", "3", "--record", "0")
    search = ("data", "mc", "--rows", "2", "--quiet", "--threads", "1")
    monkeypatch.setattr(trainings, "SECONDS", 0.0)
    play(*training, "--runs", "whole")
    play(*search, "--runs", "whole-search")
    with tiny_cluster.started(here / "data", monkeypatch, nodes=3) as cluster:
        with tiny_cluster.losing_a_node(cluster, here, "toy-0.1/synthetic/training-0+3", nth=3) as lost:
            play(*training, "--cluster", "auto")
        shutil.rmtree(here / "lost")
        with tiny_cluster.losing_a_node(cluster, here, "block 000000") as lost_too:
            play(*search, "--runs", "search", "--cluster", "auto")
    assert lost == lost_too == [True]
    assert capsys.readouterr().err.count("pieces done again because their node was lost: 1") == 2
    assert tiny_training.contents(here / "runs") == tiny_training.contents(here / "whole")
    files = contents(here / "whole-search")
    assert {name: text for name, text in contents(here / "search").items() if name in files} == files


@pytest.mark.thorough
def test_a_verification_goes_on_when_its_node_is_lost(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    play("run", "--method", "exp", "--quiet", "--record", "0", "--threads", "1")
    play("leaderboard", "build", "--runs", "runs", "--board", "board")
    words = ("leaderboard", "verify", "--all", "--board", "board", "--quiet")
    capsys.readouterr()
    play(*words, "--threads", "1")
    printed = capsys.readouterr().out
    with (
        tiny_cluster.started(here / "data", monkeypatch, nodes=2) as cluster,
        tiny_cluster.losing_a_node(cluster, here, "exp/synthetic/seed0") as lost,
    ):
        play(*words, "--cluster", "auto")
    assert lost == [True]
    assert capsys.readouterr().out == printed


@pytest.mark.thorough
def test_inputs_that_fill_the_object_store_are_kept_on_disk(here: Path, monkeypatch: pytest.MonkeyPatch):
    """Four inputs of 40 MB do not fit into a store of 80 MB, the smallest that Ray has."""
    inputs = [here / f"input{number}" for number in range(4)]
    for number, file in enumerate(inputs):
        file.write_bytes(bytes([number]) * 40_000_000)
    tasks = [
        Task(f"size {k}", partial(tiny_cluster.measure, place="file"), {"runs/file": file})
        for k, file in enumerate(inputs)
    ]
    with tiny_cluster.started(here / "data", monkeypatch, memory=80 * 2**20), RayCluster("auto", here) as cluster:
        cluster.run_all(tasks)
    assert [(here / f"sizes/{number}").read_text() for number in range(4)] == ["40000000"] * 4


@pytest.mark.thorough
def test_an_agent_that_crashes_its_process_is_not_tried_again(
    here: Path, monkeypatch: pytest.MonkeyPatch, complaint: Callable[..., str]
):
    agent = constant_agent(here, f"(open({str(here / 'tries')!r}, 'a').write('x'), __import__('os')._exit(3))")
    with tiny_cluster.started(here / "data", monkeypatch):
        words = ("run", "--method", agent, "--split", "test", "--quiet", "--cluster", "auto")
        text = complaint(*words)
        assert "constant/synthetic/seed0/test-0000-0001: its process crashed; it is not tried again" in text
        assert (here / "tries").read_text() == "x"
        constant_agent(here, "1 / 0")
        assert "the agent's act() raised ZeroDivisionError: division by zero" in complaint(*words)
