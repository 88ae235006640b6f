"""Whole trainings from the command line: the paper's table in one run, and a learner that is killed repeatedly."""

from __future__ import annotations

import json
import random
import shutil
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from baselines import schedule
from dextron_bench.cli import main
from tests.helpers import tiny_benchmark, tiny_training
from tests.helpers.tiny_training import TOY

FAST = ["--split", "test", "--seed", "0", "1", "--quiet", "--record", "0"]


@pytest.fixture
def here(training_world: Path) -> Path:
    """An empty working folder in the tiny world."""
    return training_world


@pytest.mark.slow
def test_all_makes_the_papers_table(here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("baselines.cycle.FRAMES", 60)
    monkeypatch.setattr("baselines.bc.STEPS", 5)
    monkeypatch.setitem(schedule.SCHEDULES, "smoke", schedule.Schedule(epochs=2, warm_start=60, period=1))
    words = ["run", "--all", "--preset", "smoke", *FAST, "--json"]
    assert main.main(words) == 0
    table = {row["method"]: row for row in json.loads(capsys.readouterr().out)}
    trained = {"bc-smoke", "rl-smoke", "rlil-0.1-smoke", "rlil-0.3-smoke", "sim-0.1-smoke", "sor-smoke"}
    assert table.keys() == {"exp"} | trained
    assert table["exp"]["return"] == 20.0
    assert {name: row["reaches"] for name, row in table.items() if row["reaches"] != "synthetic"} == {
        "sim-0.1-smoke": "minjerk"
    }
    of = {
        name: here / "runs" / name / "seed1" / "weights.safetensors"
        for name in ("sim-0.1-smoke/minjerk", "sor-smoke/synthetic")
    }
    assert len({file.read_bytes() for file in of.values()}) == 1
    assert main.main([*words, "--dry-run"]) == 0
    assert json.loads(capsys.readouterr().out) == []  # Nothing is left.


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "latest"),
    [
        (["--method", TOY, "--wait", "0.2"], 0.3),
        pytest.param(["--method", "rlil", "--preset", "smoke"], 1.0, marks=pytest.mark.thorough),
    ],
    ids=["toy", "rlil"],
)
def test_a_run_that_is_killed_repeatedly_ends_like_an_uninterrupted_one(
    here: Path, thorough: bool, words: list[str], latest: float
):
    """With `--thorough`, a hundred runs are killed, each at a random moment; a run that ended starts anew."""

    def start(folder: str) -> Any:
        return tiny_benchmark.start(here / "data", "run", *words, *FAST, "--runs", folder)

    def files() -> set[Path]:
        return {file for file in (here / "broken").rglob("*") if file.is_file()}

    def finish() -> None:
        process = start("broken")
        _, err = process.communicate(timeout=300)
        assert (process.returncode, err) == (0, "")
        broken = tiny_training.contents(here / "broken")
        assert whole == {name: content for name, content in broken.items() if not name.endswith(".part")}

    assert start("whole").wait(timeout=300) == 0
    whole = tiny_training.contents(here / "whole")
    kills, rng = 0, random.Random(0)
    while kills < (100 if thorough else 2):
        before, process = files(), start("broken")
        while process.poll() is None and files() <= before:
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, latest))
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            kills += 1
        process.communicate()
        if process.returncode == 0:
            finish()
            shutil.rmtree(here / "broken")
    finish()
