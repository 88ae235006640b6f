"""`sweep` through the real command line: an agent in a file and a learner, interrupted, failed, stopped and shown."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.cli import main
from dextron_bench.scores.figures import sweeps
from dextron_bench.storage import folders
from dextron_bench.sweeps import optuna_search
from tests.helpers import tiny_benchmark, tiny_training
from tests.helpers.interruptions import Interruptions
from tests.helpers.tiny_training import TOY

AGENT = """
from dataclasses import dataclass
from dextron_bench import Expert, ExpertAgent

@dataclass(frozen=True)
class Mine:
    name = "mine"
    near: float = 0.5
    gain: float = 1.4573334860056075
    def __post_init__(self):
        if self.near > 1: raise ValueError("near is above 1")
    def agent(self, seed): return Agent(Expert(self.gain, self.near))

class Agent:
    def __init__(self, expert): self._expert, self._inner = expert, ExpertAgent()
    def reset(self, episodes):
        self._inner.assign(episodes, [self._expert] * len(episodes))
        self._inner.reset(episodes)
    def act(self, states):
        if self._expert.critical < 0: raise ZeroDivisionError("oh")
        return self._inner.act(states)
"""
SOLVES = f"{tiny_benchmark.SOLVED[0][5]:.7f}"  # The critical distance of the expert of the only row of `val`.


@pytest.fixture
def here(training_world: Path) -> Path:
    """A folder with an agent in a file, in the tiny world with training."""
    (training_world / "mine.py").write_text(AGENT)
    return training_world


def sweep(*words: str, method: str = "mine.py:Mine") -> list[str]:
    return ["sweep", "--method", method, "--quiet", *words]


def content(runs: str = "runs") -> dict[str, Any]:
    [file] = Path(runs).glob("sweeps/*/sweep.json")
    return json.loads(file.read_text())


@pytest.mark.slow
def test_the_best_of_a_grid_is_chosen_on_val_alone(here: Path, capsys: pytest.CaptureFixture[str]):
    words = sweep("--grid", f"near=0.95,{SOLVES},-1,2", "--seed", "0", "1", "--name", "nearness")
    assert main.main(words) == 3  # Some trials failed.
    printed = capsys.readouterr().out
    states = [(trial["run"], trial["state"]) for trial in content()["trials"]]
    assert states == [
        ("mine-near0.95/synthetic", "done"),
        (f"mine-near{float(SOLVES)}/synthetic", "done"),
        ("mine-near-1/synthetic", "failed"),
        ("", "failed"),
    ]
    assert content()["trials"][1]["val"]["return"]["mean"] == 20.0
    assert content()["trials"][0]["val"]["return"]["mean"] < 20.0
    assert "raised ZeroDivisionError: oh" in content()["trials"][2]["error"]
    assert "near is above 1" in content()["trials"][3]["error"]
    assert content()["winner"] == {"trial": 1, "run": f"mine-near{float(SOLVES)}/synthetic", "split": "val"}
    assert "The winner has the highest mean return on val. The sweep has played no other split." in printed
    command = f"dextron-bench run --method mine.py:Mine --near {SOLVES} --reaches synthetic --seed 0 1"
    assert command in printed
    for run in here.glob("runs/mine*/synthetic/seed*"):
        assert not (run / "result.json").exists() or list(json.loads((run / "result.json").read_text())["splits"]) == [
            "val"
        ]
    assert main.main(["runs", "best", "--tag", "nearness", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["run"] == content()["winner"]["run"]
    assert main.main([*command.split()[1:], "--split", "test", "--quiet"]) == 0  # As the sweep said.
    capsys.readouterr()
    assert main.main(["sweep", "--show"]) == 0
    assert "nearness" in capsys.readouterr().out
    assert main.main(["sweep", "--show", "--name", "nearness"]) == 3
    printed = capsys.readouterr().out
    assert command in printed
    assert "winner: mine-near" in printed
    file = here / "runs/sweeps/nearness/sweep.json"
    under_way = json.loads(file.read_text())
    under_way["trials"][2] |= {"state": "started"}
    file.write_text(json.dumps(under_way))
    assert main.main(["sweep", "--show", "--name", "nearness"]) == 3
    assert "best so far: mine-near" in capsys.readouterr().out


@pytest.mark.slow
def test_the_scores_are_drawn_against_the_setting(here: Path, monkeypatch: pytest.MonkeyPatch):
    drawn: list[list[sweeps.Point]] = []
    draw = sweeps.scaling
    monkeypatch.setattr(sweeps, "scaling", lambda points, *about: (drawn.append(list(points)), draw(points, *about)))
    words = ["--grid", f"near=0.95,{SOLVES},2", "--name", "curve"]  # The method refuses the last one.
    assert main.main(sweep(*words, "--into", "pictures/curve.svg")) == 3
    assert "success [%]" in Path("pictures/curve.svg").read_text()
    assert main.main(["sweep", "--show", "--name", "curve", "--into", "again.svg"]) == 3
    assert Path("again.svg").read_bytes() == Path("pictures/curve.svg").read_bytes()
    values = [(point.value, point.returns.mean == 20.0) for point in drawn[1]]
    assert values == [(0.95, False), (float(SOLVES), True)]


@pytest.mark.slow
def test_an_interrupted_sweep_continues_with_equal_results(here: Path, monkeypatch: pytest.MonkeyPatch):
    def run(runs: str) -> int:
        words = ["--preset", "smoke", "--search", "rate=0.01..1:log", "--trials", "3", "--seed", "0", "1"]
        return main.main(sweep(*words, "--runs", runs, method=TOY))

    assert run("whole") == 0
    interruptions = Interruptions(monkeypatch)
    interruptions.finish(lambda: run("broken"))
    assert tiny_training.contents(here / "broken") == tiny_training.contents(here / "whole")
    before = interruptions.written
    assert run("broken") == 0
    assert interruptions.written == before  # Nothing is left to do.


def test_more_trials_continue_the_same_search(here: Path):
    words = sweep("--search", "near=0.1..0.9", "gain=1.1,1.4", "--name", "more")
    assert main.main([*words, "--trials", "1"]) == 0
    first = content()["trials"]
    assert main.main([*words, "--trials", "2"]) == 0
    assert content()["trials"][:1] == first
    assert main.main([*words, "--trials", "2", "--runs", "other"]) == 0
    assert content("other") == content()


def test_a_training_is_stopped_early(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    pytest.importorskip("optuna")
    monkeypatch.setattr(optuna_search, "should_stop", lambda points, earlier: len(earlier) == 1 and max(points) == 4)
    words = sweep("--preset", "quick", "--grid", "rate=0.1,0.2", "--prune", method=TOY)
    assert main.main(words) == 0
    first, second = content()["trials"]
    assert [point["epoch"] for point in first["points"]] == [2, 4, 5]
    assert (second["state"], [point["epoch"] for point in second["points"]]) == ("stopped early", [2, 4])
    assert "stopped early at epoch 4" in capsys.readouterr().out
    assert main.main(["runs", "list", "--method", "toy-0.2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["state"] == "stopped, 1 of 5 epochs left"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "line"),
    [
        ([], "give --grid near=0.04,0.06 to try every combination, or --search"),
        (["--grid", "far=1"], "the method has no setting 'far'; it has near, gain"),
        (["--grid", "near=0.1..0.2"], "a grid needs values"),
        (["--grid", "near='1"], "No closing quotation"),
        (["--grid", "near=x"], "--near: 'x' is not a number"),
        (["--grid", "near=0.1", "near=0.2"], "write each setting once"),
        (["--grid", "near=0.1", "--near", "0.3"], "--near has a value of its own"),
        (["--search", "near=0.2..0.1"], "needs finite ends, the smaller one first"),
        (["--grid", "near=0.1", "--sampler", "tpe"], "--sampler goes with --search"),
        (["--search", "near=0.1..0.2", "--trials", "0"], "--trials is 1 or more"),
        (["--grid", "near=0.1", "--name", "../up"], "is no name of a sweep"),
        (["--grid", "near=0.1", "--into", "curve.gif"], "no picture format '.gif'"),
        (["--grid", "near=0.1", "gain=1.1", "--into", "curve.png"], "--into draws the scores against one setting"),
        (["--name", "nix", "--show"], "no sweep is called 'nix'; the folder has none"),
    ],
)
def test_an_error_is_one_line(here: Path, capsys: pytest.CaptureFixture[str], words: list[str], line: str):
    assert main.main(sweep(*words)) == 2
    assert line in capsys.readouterr().err
    assert not (here / "runs").exists()


PLAIN = """
from mine import Agent
from dextron_bench import Expert

class Plain:
    name = "plain"
    def __init__(self, near: float = 0.5): self.expert = Expert(1.4573334860056075, near)
    def agent(self, seed): return Agent(self.expert)
"""


def test_a_class_that_is_no_dataclass_has_flags_too(here: Path, monkeypatch: pytest.MonkeyPatch):
    (here / "plain.py").write_text(PLAIN)
    monkeypatch.syspath_prepend(here)
    assert main.main(sweep("--grid", f"near={SOLVES},0.95", method="plain.py:Plain")) == 0
    assert content()["winner"]["run"] == f"plain-near{float(SOLVES)}/synthetic"


@pytest.mark.slow
def test_the_story_of_the_docs_runs_as_written(here: Path, capsys: pytest.CaptureFixture[str]):
    page = (Path(__file__).parents[2] / "docs/sweeps.md").read_text()
    story = page.partition("## A story")[2].partition("## What to vary")[0]
    commands = [line for line in story.splitlines() if line.startswith("dextron-bench ")]
    assert len(commands) == 6
    for command in commands:
        assert main.main(shlex.split(command)[1:]) == 0
    assert "winner: my-agent" in capsys.readouterr().out
    assert [trial["run"] for trial in content()["trials"]] == [
        "my-agent/synthetic", "my-agent-near0.15/synthetic", "my-agent-near0.18/synthetic"
    ]  # fmt: skip


def test_a_name_belongs_to_one_question_and_one_process(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(sweep("--grid", f"near={SOLVES}", "--name", "one")) == 0
    place = Path("runs/sweeps/one")
    with folders.locked(place, place):
        assert main.main(sweep("--grid", f"near={SOLVES}", "--name", "one")) == 2
    assert "another process is changing runs/sweeps/one" in capsys.readouterr().err
    assert main.main(sweep("--grid", "near=0.2", "--name", "one")) == 2
    assert "runs/sweeps/one holds another sweep: it differs in space (near); give another --name" in (
        capsys.readouterr().err
    )
