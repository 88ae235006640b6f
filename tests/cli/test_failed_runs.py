"""Runs that fail or are interrupted: an exit code, at most one line, and nothing that would count as a result."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.runs.result_files import read_result
from dextron_bench.storage import atomic
from tests.helpers import tiny_benchmark

AGENT = """
import numpy as np

class Mine:
    name = "mine"
    def agent(self, seed): return self
    def reset(self, episodes): ...
    def act(self, states):
        actions = np.zeros((len(states), 1))
        {spoil}
        return actions
"""


@pytest.fixture
def here(tiny_world: Path) -> Path:
    return tiny_world


def mine(folder: Path, spoil: str) -> str:
    """A method whose agent sends zeros, except for what the statement `spoil` changes."""
    (folder / "mine.py").write_text(AGENT.format(spoil=spoil))
    return "mine.py:Mine"


def run(method: str, *words: str) -> list[str]:
    return ["run", "--method", method, "--split", "test", "--quiet", "--record", "0", *words]


def test_an_agent_that_fails_in_some_episodes_is_code_3_and_other_episodes_count(
    here: Path, capsys: pytest.CaptureFixture[str]
):
    for spoil, failure in (("actions[0] = np.nan", "action is nan"), ("actions[0] = 1.001", "is outside [-1, 1]")):
        assert main.main(run(mine(here, spoil), "--json", "--runs", failure[:9])) == 3
        printed = capsys.readouterr()
        (row,) = json.loads(printed.out)
        assert "dextron-bench: 1 episode of mine failed: action" in printed.err
        assert (row["episodes"], row["failed"]) == (2, 1)
        episodes = pd.read_parquet(here / failure[:9] / "mine" / "synthetic" / "seed0" / "episodes.parquet")
        assert failure in episodes["failure"][0]
        assert (episodes["failure"][1], episodes["length"][0]) == ("", 0)
        assert episodes["length"][1] > 30
        for name in [name for name in sys.modules if name.startswith("dextron_entrant_")]:
            del sys.modules[name]


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        ("actions = actions[:, 0]", "act() must return floats of shape (2, 1)"),
        ("actions = None", "act() must return floats"),
        ("raise ZeroDivisionError('oh')", "the agent's act() raised ZeroDivisionError: oh"),
        ("raise OSError(2, 'No weights')", "raised FileNotFoundError: [Errno 2] No weights"),
    ],
)
def test_an_agent_that_cannot_play_is_one_line(here: Path, complaint: Callable[..., str], spoil: str, expected: str):
    assert expected in complaint(*run(mine(here, spoil)))
    assert not list(here.rglob("result.json"))


def test_an_agent_that_cannot_begin_is_one_line(here: Path, complaint: Callable[..., str]):
    (here / "mine.py").write_text(
        'class Mine:\n    name = "mine"\n\n    def agent(self, seed):\n        raise ValueError("oh")\n'
    )
    assert "raised ValueError: oh" in complaint(*run("mine.py:Mine", "--seed", "4"))


def test_a_file_where_the_folder_should_be_is_one_line(here: Path, complaint: Callable[..., str]):
    (here / "runs").write_text("")
    assert "runs" in complaint(*run("nothing"))
    assert (here / "runs").read_text() == ""


def test_a_full_disk_is_one_line_and_leaves_no_partial_file(
    here: Path, monkeypatch: pytest.MonkeyPatch, complaint: Callable[..., str]
):
    write_atomically = atomic.write_atomically

    def full(file: Path, write: Callable[[Path], object]) -> None:
        def fill(part: Path) -> None:
            write(part)
            part.write_bytes(part.read_bytes()[:50])
            raise OSError(28, "No space left on device", str(file))

        write_atomically(file, fill if file.name == "episodes.parquet" else write)

    monkeypatch.setattr(atomic, "write_atomically", full)
    line = complaint(*run("nothing"))
    assert "No space left on device: runs/nothing/synthetic/seed0/episodes.parquet" in line
    assert sorted(os.listdir("runs/nothing/synthetic/seed0")) == [
        "config.json",
        "failure.json",
        "provenance.json",
        "times.json",
    ]


@pytest.mark.slow
def test_an_interrupted_run_is_code_130_and_continues_later(here: Path, capsys: pytest.CaptureFixture[str]):
    spoil = "import time; open('started', 'w').close(); time.sleep(0.05)"
    words = run(mine(here, spoil))
    process = tiny_benchmark.start(here / "data", *words)
    waited = time.monotonic()
    while not (here / "started").exists() and time.monotonic() - waited < 120 and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (130, "dextron-bench: interrupted\n")
    left = here / "runs" / "mine" / "synthetic" / "seed0"
    assert sorted(os.listdir(left)) == ["config.json", "provenance.json", "times.json"]
    assert main.main(words) == 0
    assert len(read_result(left / "result.json")["splits"]["test"]["scores"]) == 2
