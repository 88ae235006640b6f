"""A run that plays episodes is seen by other processes, until it ends or is killed."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from dextron_bench.runs import playing
from dextron_bench.storage.progress import no_progress
from dextron_bench.storage.run_folder import RunFolder

SCRIPT = """
import sys, time
from pathlib import Path
from dextron_bench.runs import playing
from dextron_bench.storage.progress import no_progress
from dextron_bench.storage.run_folder import RunFolder
with playing.shown(RunFolder(Path(sys.argv[1])), no_progress) as report:
    report(3, 8)
    print("playing", flush=True)
    time.sleep(600)
"""


def test_a_process_that_plays_is_seen_until_it_is_killed(tmp_path: Path):
    folder = RunFolder(tmp_path)
    assert playing.state(folder) == ""
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "playing\n"
        assert playing.state(folder) == "3 of 8 episodes"
        process.kill()
    assert playing.state(folder) == ""


def test_the_file_is_gone_at_the_end_and_reports_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(time, "monotonic", iter([100.0, 100.0, 100.5, 101.0, 101.0]).__next__)
    reports: list[tuple[int, int]] = []
    with playing.shown(RunFolder(tmp_path), lambda done, total, note="": reports.append((done, total))) as report:
        report(1, 8)
        report(2, 8)  # Within a second of the first: shown to the caller alone.
        assert playing.state(RunFolder(tmp_path)) == "1 of 8 episodes"
        report(3, 8)
        assert playing.state(RunFolder(tmp_path)) == "3 of 8 episodes"
    assert reports == [(1, 8), (2, 8), (3, 8)]
    assert not (tmp_path / playing.FILE).exists()


def test_two_processes_may_play_the_same_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The second is shown when the first has ended, as the shares of a run end one after the other."""
    monkeypatch.setattr(playing, "PERIOD", 0.0)
    with playing.shown(RunFolder(tmp_path), no_progress) as second:
        with playing.shown(RunFolder(tmp_path), no_progress) as first:
            first(1, 2)
            second(3, 9)
        assert playing.state(RunFolder(tmp_path)) == "3 of 9 episodes"
    with playing.shown(RunFolder(tmp_path), no_progress) as first:
        with playing.shown(RunFolder(tmp_path), no_progress) as second:
            first(1, 2)
            second(3, 9)
            assert playing.state(RunFolder(tmp_path)) == "1 of 2 episodes"
            assert not list(tmp_path.glob("*.part"))
        assert playing.state(RunFolder(tmp_path)) == "1 of 2 episodes"
