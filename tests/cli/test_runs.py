"""`runs` through the real command line: two agents and a failed one, listed, compared, marked and put away."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.cli import main
from tests.helpers import tiny_benchmark

AGENT = """
from dataclasses import dataclass
import numpy as np

class Agent:
    def reset(self, episodes): ...
    def act(self, states): return np.zeros((len(states), 2 if {broken} else 1))

@dataclass(frozen=True)
class Mine:
    name = "{name}"
    near: float = 0.1
    def agent(self, seed): return Agent()
"""


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of EXP, of an agent with two settings, and of an agent that failed, in the tiny world."""
    common = ["--split", "test", "--quiet", "--record", "0"]
    with tiny_benchmark.working_folder(tmp_path_factory.mktemp("listed")) as folder:
        (folder / "mine.py").write_text(AGENT.format(name="mine", broken=False))
        (folder / "broken.py").write_text(AGENT.format(name="broken", broken=True))
        for words, code in (
            (["exp"], 0),
            (["mine.py:Mine"], 0),
            (["mine.py:Mine", "--near", "0.2"], 0),
            (["broken.py:Mine"], 2),
        ):
            assert main.main(["run", "--method", *words, *common]) == code
    return folder


@pytest.fixture
def here(tiny_world: Path, played: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A folder with a copy of these runs and agents."""
    shutil.copytree(played, tiny_world, dirs_exist_ok=True)
    capsys.readouterr()
    return tiny_world


@pytest.fixture
def runs(here: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Runs a command of the group and returns what it printed."""

    def run(*words: str) -> str:
        assert main.main(["runs", *words]) == 0
        return capsys.readouterr().out

    return run


@pytest.mark.slow
def test_runs_are_listed_with_scores_and_states(runs: Callable[..., str]):
    rows: list[dict[str, Any]] = json.loads(runs("list", "--json", "--sort", "return"))
    assert [row["run"].removesuffix("/synthetic") for row in rows] == ["exp", "mine", "mine-near0.2", "broken"]
    assert [row["return"] for row in rows] == [20.0, 0.0, 0.0, None]
    assert rows[-1]["state"].startswith("failed: AgentError: act() must return floats of shape")
    [named, line] = csv.reader(
        io.StringIO(runs("list", "--csv", "--setting", "near=0.2", "--columns", "run", "settings.near"))
    )
    assert (named, line) == (["run", "settings.near"], ["mine-near0.2/synthetic", "0.2"])
    assert "100.0 %" in runs("list", "--method", "exp")


@pytest.mark.slow
def test_a_run_is_shown_and_compared(runs: Callable[..., str]):
    assert json.loads(runs("show", "exp", "--json"))["splits"] == [
        {"split": "test", "seeds": 1, "rows": 2, "return": 20.0, "success": 1.0}
    ]
    shown = runs("show", "exp")
    assert "dextron-bench run --method baselines.exp:Exp --reaches synthetic --seed 0 " in shown
    assert "20.00 [20.00, 20.00]" in shown
    assert "100.0 [100.0, 100.0]" in shown
    assert "--near 0.2 --reaches synthetic" in runs("show", "mine-near0.2")
    compared = json.loads(runs("compare", "mine", "mine-near0.2", "--json"))
    assert compared["settings"] == {"mine/synthetic": {"near": 0.1}, "mine-near0.2/synthetic": {"near": 0.2}}
    assert [(row["split"], row["mine/synthetic"]) for row in compared["scores"]] == [
        ("test, return", "0.00 [0.00, 0.00]"),
        ("test, success %", "0.0 [0.0, 0.0]"),
    ]
    assert "near" in runs("compare", "mine", "mine-near0.2")
    assert runs("best", "--split", "test") == "mine/synthetic: return 0.00, success 0.0 % on test\n"


@pytest.mark.slow
def test_runs_are_marked(runs: Callable[..., str]):
    runs("tag", "exp", "good", "old")
    runs("tag", "exp", "old", "--remove")
    runs("note", "exp", "the ceiling")
    [row] = json.loads(runs("list", "--json", "--tag", "good"))
    assert (row["run"], row["tags"], row["note"]) == ("exp/synthetic", ["good"], "the ceiling")


@pytest.mark.slow
def test_runs_are_archived_and_removed_only_when_that_is_confirmed(
    here: Path, runs: Callable[..., str], capsys: pytest.CaptureFixture[str]
):
    assert runs("archive", "mine") == "runs-archive/mine/synthetic\n"
    assert (here / "runs-archive/mine/synthetic/seed0/result.json").exists()
    assert not (here / "runs/mine").exists()
    assert main.main(["runs", "rm", "exp"]) == 2
    assert "confirm with --yes" in capsys.readouterr().err
    runs("rm", "exp", "--yes")
    assert not (here / "runs/exp").exists()
    assert {row["run"] for row in json.loads(runs("list", "--json"))} == {"broken/synthetic", "mine-near0.2/synthetic"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["show", "nix"], "no run is called 'nix'; the folder has broken/synthetic, exp/synthetic"),
        (["list", "--columns", "nix"], "no column 'nix'; choose from run, state"),
        (["list", "--split", "nix"], "no run has played 'nix'; there are test\n"),
        (["list", "--state", "nix"], "--state 'nix': choose from done, training, playing"),
        (["compare", "exp", "mine", "--into", "curves.png"], "none of these runs has a learning curve to draw"),
        (["list", "--since", "today"], "write a date such as 2026-01-31"),
        (["best", "--split", "open"], "none of the 3 runs has a score on 'open'"),
        (["tag", "exp", "a b"], "use letters, digits and"),
        (["export", "--into", "data"], "data is not empty"),
    ],
)
def test_an_error_is_one_line(here: Path, capsys: pytest.CaptureFixture[str], words: list[str], line: str):
    assert main.main(["runs", *words]) == 2
    assert line in capsys.readouterr().err
