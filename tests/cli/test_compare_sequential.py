"""`dextron-bench compare --sequential` through the command line, on a tiny split."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.runs import in_order, result_files
from tests.helpers import tiny_benchmark
from tests.helpers.tiny_runs import constant_agent

ROWS = 24


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working folder; `exp` solves all 24 rows of `test`, and a hand that never closes solves none."""
    rows = pd.DataFrame([("test", *tiny_benchmark.SOLVED[0])] * ROWS, columns=tiny_benchmark.COLUMNS)
    monkeypatch.setattr(in_order, "SLOTS", 4)
    monkeypatch.setattr(result_files, "published_results", lambda: tmp_path / "published")
    with tiny_benchmark.working_folder(tmp_path, rows):
        yield tmp_path


def compared(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> dict[str, Any]:
    capsys.readouterr()
    assert main.main(["compare", *arguments, "--sequential", "--quiet", "--threads", "1", "--json"]) == code
    return json.loads(capsys.readouterr().out)


def test_it_stops_when_it_is_decided_and_says_what_it_saved(here: Path, capsys: pytest.CaptureFixture[str]):
    """Eight differences of 20 decide; then four episodes of each agent are under way, so twelve are left."""
    result = compared(capsys, "nothing", "exp")
    assert (result["better"], result["compared"], result["rows"]) == ("b", 8, ROWS)
    assert result["a"] == {
        **{"name": "nothing", "seeds": 1, "stored": False, "begun": 12},
        **{"saved": 12, "failed": 0, "return": 0.0},
    }
    assert result["return"]["after"] == result["success"]["after"] == 8
    assert 0.0 <= result["return"]["low"] < result["return"]["high"] == 20.0


def test_a_finished_run_is_compared_without_playing_it(here: Path, capsys: pytest.CaptureFixture[str]):
    run = ["run", "--method", "nothing", "--split", "test", "--quiet", "--threads", "1"]
    assert main.main(run) == 0
    result = compared(capsys, "nothing", "exp")
    assert (result["a"]["stored"], result["a"]["begun"], result["b"]["begun"]) == (True, 0, 12)


def test_a_finished_run_of_an_agent_in_a_file_is_not_played_again(here: Path, capsys: pytest.CaptureFixture[str]):
    agent = constant_agent(here, "-1.0")
    assert main.main(["run", "--method", agent, "--split", "test", "--quiet", "--threads", "1"]) == 0
    assert compared(capsys, agent, "exp")["a"]["stored"]
    with (here / "constant.py").open("a") as file:
        file.write("# Other code.\n")
    assert not compared(capsys, agent, "exp")["a"]["stored"]


def test_equal_methods_stay_undecided(here: Path, capsys: pytest.CaptureFixture[str]):
    result = compared(capsys, "nothing", constant_agent(here, "-1.0"))
    assert (result["better"], result["compared"], result["return"]["after"]) == (None, ROWS, None)
    assert result["return"]["low"] < 0.0 < result["return"]["high"]
    assert result["b"]["saved"] == 0


def test_the_text_says_what_was_decided_and_saved(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(["compare", "exp", "nothing", "--sequential", "--quiet", "--threads", "1"]) == 0
    printed = capsys.readouterr().out
    assert "A scores more; compared on 8 of 24 settings\n" in printed
    assert "A: 12 of 24 episodes begun (1 seed), 12 saved\n" in printed
    assert "-20.00 [-20.00, " in printed


def test_the_exit_codes(here: Path, capsys: pytest.CaptureFixture[str]):
    compared(capsys, "exp", "nothing", "--fail-if-worse", code=1)
    compared(capsys, "nothing", "exp", "--fail-if-worse")
    result = compared(capsys, "exp", constant_agent(here, "np.nan", "broken"), code=3)
    assert result["b"]["failed"] >= 8


def test_wrong_use_is_one_line(here: Path, complaint: Callable[..., str]):
    expected = {
        ("nothing", "exp", "random"): "--sequential compares two methods, and draws no picture",
        ("nothing", "exp", "--into", "x.png"): "--sequential compares two methods, and draws no picture",
        ("nothing", "expp"): "no method 'expp'",
        ("nothing", "exp", "--split", "val"): "no split 'val' of 'synthetic' reaches; choose from test",
    }
    for arguments, line in expected.items():
        assert line in complaint("compare", *arguments, "--sequential", "--quiet")
