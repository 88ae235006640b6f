"""The checks of valid and invalid agents, and the template of `dextron-bench new-agent`."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.methods.isolation.launch import prepare_launch
from dextron_bench.submissions.conformance import MEND, NOTE, OK, Check, checks
from tests.helpers import tiny_benchmark
from tests.helpers.isolated_play import write_agent

ROWS = pd.concat(
    [tiny_benchmark.ROWS, tiny_benchmark.ROWS.query("split == 'test'").assign(split="val")], ignore_index=True
)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    tiny_benchmark.write(tmp_path / "splits", ROWS)
    tiny_benchmark.install(tmp_path / "splits", monkeypatch.setattr)
    yield
    tiny_benchmark.forget()


def check(tmp_path: Path, act: str) -> dict[str, Check]:
    launch = prepare_launch(write_agent(tmp_path, act))
    return {check.what: check for check in checks(launch, limits=Limits(answer=20.0))}


@pytest.mark.slow
def test_the_template_passes_the_checks_and_its_own_test(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = tmp_path / "mine"
    assert main.main(["new-agent", str(folder)]) == 0
    process = subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"], cwd=folder, check=False)
    assert process.returncode == 0
    assert main.main(["check", f"{folder}/agent.py:MyAgent"]) == 0
    printed = capsys.readouterr().out
    assert "mend" not in printed
    assert "ready: dextron-bench submit" in printed
    assert main.main(["new-agent", str(folder)]) == 2
    assert "exists already; name a new folder" in capsys.readouterr().err


@pytest.mark.slow
def test_random_numbers_without_the_seed_are_a_fault(tmp_path: Path):
    results = check(tmp_path, "return self.rng.uniform(-1, 1, (len(states), 1))")
    assert results["it is deterministic under a seed"].verdict == MEND
    assert results["actions do not depend on other rows"].verdict == NOTE


@pytest.mark.slow
def test_actions_that_depend_on_other_rows_are_noted(tmp_path: Path):
    results = check(tmp_path, "return np.full((len(states), 1), 1.0 / len(states))")
    assert results["it is deterministic under a seed"].verdict == OK
    assert results["actions do not depend on other rows"].verdict == NOTE


def test_a_failure_ends_the_checks(tmp_path: Path):
    results = check(tmp_path, "return np.full((len(states), 1), 2.0)")
    assert list(results) == ["it starts", "actions are finite, in [-1, 1], one per row"]
    assert "3 episodes failed: action 2.0 is outside [-1, 1] at step 0" in list(results.values())[1].detail
    (tmp_path / "mine.py").write_text("import nothing_of_that_name")
    (only,) = checks(prepare_launch(f"{tmp_path}/mine.py:Agent"))
    assert (only.what, only.verdict) == ("it starts", MEND)
    assert "nothing_of_that_name" in only.detail


@pytest.mark.slow
def test_an_agent_for_few_episodes_at_once_has_a_fault(tmp_path: Path):
    results = check(tmp_path, "return np.zeros((min(len(states), 9), 1))")
    assert results["it is fast enough"].verdict == MEND
    assert "act() must return floats of shape (256, 1)" in results["it is fast enough"].detail
