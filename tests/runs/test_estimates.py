"""What is left to do of a run: episodes that are stored are not counted."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.runs import estimates, run_files
from dextron_bench.runs.plans import Plan, resolve
from tests.helpers import tiny_benchmark


def test_stored_episodes_are_not_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The tiny benchmark has two rows of `test`, which are stored, and one of `unseen-reach`."""
    monkeypatch.setattr(estimates, "seconds_per_episode", lambda reaches, threads: 0.5)
    with tiny_benchmark.working_folder(tmp_path):
        run = resolve(Plan("exp", "synthetic"))
        rows = estimates.estimate([[run]], tmp_path / "runs")
        assert [(row.left, row.seconds) for row in rows] == [("3 episodes", 1.5)]
        stored = pd.DataFrame({"split": ["test", "test"]})
        monkeypatch.setattr(run_files, "stored_episodes", lambda folder, splits: stored)
        rows = estimates.estimate([[run]], tmp_path / "runs")
        assert [(row.left, row.seconds) for row in rows] == [("1 episodes", 0.5)]
