"""Commands on a real Ray with several nodes: the same bytes, lost nodes, failures of the work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dextron_bench.cli import main
from dextron_bench.experts import montecarlo
from tests.cli.test_shares import contents
from tests.helpers import tiny_benchmark, tiny_cluster, tiny_training
from tests.helpers.tiny_runs import constant_agent

pytestmark = pytest.mark.slow
RUN = ("run", "--method", "exp", "--no-floors", "--quiet", "--threads", "1")


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


def test_the_bytes_are_the_same_without_a_cluster_and_on_one_and_two_nodes(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    search = ("mc", "--rows", "2", "--quiet", "--threads", "1")
    play(*RUN, "--runs", "whole")
    play(*search, "--runs", "whole")
    files, printed = contents(here / "whole"), capsys.readouterr().out
    with tiny_cluster.started(here / "data", monkeypatch) as cluster:
        for runs in ("one", "two"):
            play(*RUN, "--runs", runs, "--cluster", "auto")
            play(*search, "--runs", runs, "--cluster", "auto")
            more = {name: content for name, content in contents(here / runs).items() if name in files}
            assert more == files
            assert capsys.readouterr().out == printed.replace("whole", runs)
            cluster.add_node(num_cpus=1)


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
    assert "1 pieces were done again, because their node was lost" in capsys.readouterr().err


def test_an_agent_that_crashes_its_process_is_not_tried_again(
    here: Path, monkeypatch: pytest.MonkeyPatch, complaint: Callable[..., str]
):
    agent = constant_agent(here, f"(open({str(here / 'tries')!r}, 'a').write('x'), __import__('os')._exit(3))")
    with tiny_cluster.started(here / "data", monkeypatch):
        words = ("run", "--method", agent, "--split", "test", "--no-floors", "--quiet", "--cluster", "auto")
        text = complaint(*words)
        assert "constant/synthetic/seed0/test-0000-0001: its process crashed; it is not tried again" in text
        assert (here / "tries").read_text() == "x"
        constant_agent(here, "1 / 0")
        assert "the agent's act() raised ZeroDivisionError: division by zero" in complaint(*words)
