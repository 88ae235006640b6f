"""`dextron-bench compare plan` on invented results."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.cli import main
from dextron_bench.runs import result_files
from tests.cli.test_compare import ROWS, write

PLAN = ["compare", "plan", "fixed", "trained"]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with runs: `fixed` with one seed, and `trained` with three seeds that differ."""
    rng = np.random.default_rng(0)
    write(tmp_path / "runs", "fixed", 20.0 * (rng.uniform(size=ROWS) < 0.8))
    for seed, share in enumerate((0.75, 0.8, 0.85)):
        write(tmp_path / "runs", "trained", 20.0 * (rng.uniform(size=ROWS) < share), seed)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(result_files, "published_results", lambda: tmp_path / "published")
    return tmp_path


def test_more_seeds_need_fewer_settings(here: Path, capsys: pytest.CaptureFixture[str]):
    assert (
        main.main(["compare", "plan", "fixed", "trained", "--difference", "5", "--seeds", "5", "20", "80", "--json"])
        == 0
    )
    result = json.loads(capsys.readouterr().out)
    settings = [plan["settings"] or np.inf for plan in result["plans"]]
    assert settings == sorted(settings, reverse=True)
    assert settings[-1] < np.inf
    assert result["plans"][-1]["episodes"] == 81 * settings[-1]  # `fixed` keeps one seed.


def test_the_text_names_what_the_plan_is_made_from(here: Path, capsys: pytest.CaptureFixture[str]):
    assert (
        main.main(["compare", "plan", "fixed", "trained", "--measure", "return", "--difference", "0.1", "--seeds", "2"])
        == 0
    )
    printed = capsys.readouterr().out
    assert "to show a difference of 0.1 in return between fixed and trained" in printed
    assert "more seeds are needed" in printed
    assert "1 seed of fixed and 3 of trained on 500 settings" in printed


def test_wrong_use_is_one_line(here: Path, complaint: Callable[..., str]):
    assert "--difference must be above 0" in complaint("compare", "plan", "fixed", "trained", "--difference", "0")
    assert "--seeds at least 2" in complaint("compare", "plan", "fixed", "trained", "--seeds", "1")
    assert "no result of 'other'" in complaint("compare", "plan", "fixed", "other")
