"""Commands with `--cluster`, whose tasks run in this process: the same bytes as without it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dextron_bench.cli import main
from dextron_bench.cluster import pieces, ray_cluster, trainings, worker
from dextron_bench.cluster.tasks import OtherVersion
from dextron_bench.experts import montecarlo, search_work
from dextron_bench.storage.pieces import Place
from dextron_bench.success import generation
from tests.cli.test_shares import contents, on_machine
from tests.cli.test_sweep import AGENT
from tests.helpers import tiny_benchmark, tiny_cluster, tiny_training
from tests.helpers.immediate_cluster import ImmediateCluster
from tests.helpers.tiny_runs import constant_agent
from tests.helpers.tiny_training import TOY

CLUSTER = ("--cluster", "local")
BREAKING = """
from dataclasses import dataclass, replace
from tests.helpers.toy_learner import Toy

@dataclass(frozen=True)
class Breaking(Toy):
    def trainer(self, track, seeds):
        breaks = 1 if self.rate == 0.2 else 0
        return super(Breaking, replace(self, breaks=breaks)).trainer(track, seeds)
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty working folder with the tiny benchmark, small pieces, and a cluster in this process."""
    tiny_cluster.install(tiny_training.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.setattr(montecarlo.Search.__init__, "__defaults__", ("synthetic", 0, 3, 4))
    monkeypatch.setattr(generation.DatasetConfig.__init__, "__defaults__", ("synthetic", 0, (), 5))
    monkeypatch.setattr(ray_cluster, "RayCluster", ImmediateCluster)
    monkeypatch.setattr(ray_cluster.importlib.util, "find_spec", lambda name: object())
    (tmp_path / "node").mkdir()
    monkeypatch.setattr(worker.tempfile, "tempdir", str(tmp_path / "node"))
    for name in (*worker.THREAD_VARIABLES, "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    monkeypatch.chdir(tmp_path)
    on_machine("here", monkeypatch)
    yield tmp_path
    tiny_benchmark.forget()


def play(*words: str | Path) -> None:
    assert main.main([*map(str, words)]) == 0


@pytest.mark.slow
def test_a_search_and_a_run_have_the_same_bytes(here: Path):
    for words in (("data", "mc", "--rows", "3"), ("run", "--method", "exp", "--split", "test")):
        play(*words, "--quiet", "--threads", "1", "--runs", "whole")
        play(*words, "--quiet", *CLUSTER)
    files = contents(here / "whole")
    assert {name: text for name, text in contents(here / "runs").items() if name in files} == files


@pytest.mark.slow
def test_a_training_goes_on_task_by_task(here: Path, monkeypatch: pytest.MonkeyPatch):
    """A task ends at each checkpoint, after epochs 2, 4 and 5, and one loses its node."""
    monkeypatch.setattr(trainings, "SECONDS", 0.0)
    clusters: list[ImmediateCluster] = []
    name = "toy-0.1/synthetic/training-0+3"

    class Losing(ImmediateCluster):
        def __init__(self, address: str, runs: Path, threads: int = 0) -> None:
            super().__init__(address, runs, threads)
            self.losing[name] = 1
            clusters.append(self)

    words = ("run", "--method", TOY, "--preset", "quick", "--quiet", "--split", "val")
    words += ("--seed", "0", "3", "--record", "0")
    play(*words, "--threads", "1", "--runs", "whole")
    monkeypatch.setattr(ray_cluster, "RayCluster", Losing)
    play(*words, *CLUSTER)
    assert clusters[0].order.count(name) == 4
    assert tiny_training.contents(here / "runs") == tiny_training.contents(here / "whole")


def test_an_evaluation_of_weights_in_a_file_has_the_same_bytes(here: Path):
    """The weights and the file of the method go to the node, below its own folder of runs."""
    play("run", "--method", TOY, "--preset", "smoke", "--quiet", "--split", "val", "--record", "0", "--threads", "1")
    weights = ("--weights", here / "runs/toy-0.1/synthetic/seed0/weights.safetensors")
    words = ("eval", "--method", TOY, "--preset", "smoke", "--quiet", "--split", "test", *weights)
    play(*words, "--threads", "1", "--runs", "whole")
    play(*words, "--runs", "clustered", *CLUSTER)
    assert contents(here / "clustered") == contents(here / "whole")


def test_a_piece_of_another_version_of_the_work_is_not_played(here: Path):
    """The node has the same installation, and a search of another seed, so its blocks would be other ones."""
    work = search_work.open_work(Place(here, here / "mc", 1), montecarlo.Search(), 3)
    arguments = (here, 1, work.recipe("000000"), "mc", "000000", {"search": {"seed": 1}})
    with pytest.raises(OtherVersion, match="another version of block 000000: it differs in search; install the same"):
        pieces.play_piece(*arguments)


@pytest.mark.slow
def test_a_data_set_has_the_same_bytes(here: Path):
    words = ("success", "data", "--rows", "300", "--quiet")
    play(*words, "--threads", "1", "--runs", "whole")
    play(*words, *CLUSTER)
    files = contents(here / "whole")
    assert {name: text for name, text in contents(here / "runs").items() if name in files} == files
    assert not (here / "runs/success/synthetic/seed0/pieces").exists()


@pytest.mark.slow
def test_a_submission_is_the_same_bundle(here: Path, complaint: Callable[..., str]):
    words = ("submit", constant_agent(here, "0.1", "steady"), "--name", "mine", "--seed", "0", "--quiet")
    words += ("--record", "0", "--timeout", "300")
    play(*words, "--runs", "whole", "--into", "whole.zip")
    play(*words, "--into", "cluster.zip", *CLUSTER)
    assert (here / "cluster.zip").read_bytes() == (here / "whole.zip").read_bytes()
    text = complaint("submit", "exec:true", "--name", "other", "--seed", "0", "--quiet", *CLUSTER)
    assert "exec:true lies on this machine alone: use --share on machines that have it" in text


@pytest.mark.slow
def test_a_board_is_verified_as_without_a_cluster(here: Path, capsys: pytest.CaptureFixture[str]):
    for method in ("exp", "nothing"):
        play("run", "--method", method, "--quiet", "--record", "0")
    play("leaderboard", "build", "--runs", "runs", "--board", "board")
    result = here / "board/results/nothing/synthetic/seed0/result.json"
    result.write_text(result.read_text().replace("0.0", "1.0", 1))
    words = ["leaderboard", "verify", "--all", "--board", "board", "--quiet", "--threads", "1"]
    capsys.readouterr()
    assert main.main(words) == 1
    printed = capsys.readouterr().out
    assert "DIFFERS from its episodes" in printed
    assert main.main([*words, *CLUSTER]) == 1
    assert capsys.readouterr().out == printed


@pytest.mark.slow
def test_a_sweep_has_the_same_trials_and_goes_on_without_those_that_fail(here: Path):
    """One of three trainings raises an error; of three distances, the agent raises one at one, and refuses one."""
    (here / "mine.py").write_text(AGENT)
    (here / "breaking.py").write_text(BREAKING)
    learner = ("sweep", "--method", "breaking.py:Breaking", "--preset", "quick", "--quiet", "--seed", "0", "3")
    learner += ("--name", "rates")
    agent = ("sweep", "--method", "mine.py:Mine", "--quiet", "--name", "distances", "--grid", "near=0.5,-1,2")
    for words in ((*learner, "--grid", "rate=0.1,0.2,0.3"), agent):
        assert main.main([*words, "--threads", "1", "--runs", "whole"]) == 3
        assert main.main([*words, *CLUSTER]) == 3
    for name, states in (("rates", ["done", "failed", "done"]), ("distances", ["done", "failed", "failed"])):
        files = [here / runs / f"sweeps/{name}/sweep.json" for runs in ("runs", "whole")]
        trials, others = ([{**trial, "error": ""} for trial in json.loads(f.read_text())["trials"]] for f in files)
        assert trials == others
        assert [trial["state"] for trial in trials] == states


def test_a_sweep_whose_trials_depend_on_earlier_ones_is_refused(here: Path, complaint: Callable[..., str]):
    words = ("sweep", "--method", TOY, "--search", "rate=0.1..1", "--sampler", "tpe", "--quiet", *CLUSTER)
    assert "leave those out, or leave out --cluster" in complaint(*words)
