"""Estimates of the time that is left, from recorded durations."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dextron_bench.training import timing

ROWS = [("epoch", 2.0), ("epoch", 3.0), ("epoch", 100.0), ("evaluation", 1.0)]


@pytest.fixture
def timed(tmp_path: Path) -> Path:
    """A folder with durations; the last line is incomplete."""
    lines = [json.dumps({"what": what, "seconds": seconds}) for what, seconds in ROWS]
    (tmp_path / "timing.jsonl").write_text("\n".join([*lines, '{"what": "ep']))
    return tmp_path


def test_the_time_left_uses_median_durations(timed: Path):
    assert timing.seconds_left(timed, 11, 2) == 11 * 3.0 + 6 * 1.0


def test_the_time_so_far_is_the_sum_of_all_durations(timed: Path):
    assert timing.seconds(timed) == 106.0


def test_without_durations_the_time_is_unknown(tmp_path: Path):
    assert timing.seconds_left(tmp_path, 10, 2) is None
    assert timing.seconds(tmp_path) is None


def test_an_appended_row_counts(tmp_path: Path):
    timing.append(tmp_path, "epoch", 1, 2.00004, "cpu")
    row = json.loads((tmp_path / "timing.jsonl").read_text())
    assert 10.0 < row.pop("memory", 20.0) < 1e6  # [MB] of a process that has loaded NumPy; only Linux reports it.
    assert row == {"what": "epoch", "epoch": 1, "seconds": 2.0, "device": "cpu"}
    assert timing.seconds_left(tmp_path, 3, 2) == 6.0  # No evaluation was timed yet.
