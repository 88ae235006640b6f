"""The begin and the end of a run are in its files, and not in the times of these files."""

from __future__ import annotations

import json
import os
import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest

from dextron_bench.storage import run_times
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.storage.run_times import RunTimes


@pytest.fixture
def run(tmp_path: Path) -> RunFolder:
    return RunFolder(tmp_path / "mine/real/seed0")


def test_a_run_that_is_resumed_keeps_its_begin_and_has_its_last_end(run: RunFolder, monkeypatch: pytest.MonkeyPatch):
    for hour in (1, 2, 3, 4):
        monkeypatch.setattr(run_times, "_now", lambda hour=hour: f"2026-01-01T0{hour}:00:00+00:00")
        (run_times.note_begin if hour % 2 else run_times.note_end)(run)
    assert run_times.read(run) == RunTimes(datetime(2026, 1, 1, 1, tzinfo=UTC), datetime(2026, 1, 1, 4, tzinfo=UTC))


def test_a_copy_has_the_times_of_the_run(run: RunFolder, tmp_path: Path):
    run_times.note_begin(run)
    shutil.copytree(run.path, tmp_path / "copy")
    os.utime(tmp_path / "copy/times.json", (0, 0))
    assert run_times.read(RunFolder(tmp_path / "copy")) == run_times.read(run)


def test_a_run_of_an_earlier_version_has_no_times(run: RunFolder):
    assert run_times.read(run) == RunTimes(None, None)


@pytest.mark.parametrize("moment", ["yesterday", "2026-01-01T01:00:00", 5])
def test_a_time_without_a_zone_is_refused(run: RunFolder, moment: object):
    run.path.mkdir(parents=True)
    run.times.write_text(json.dumps({"began": moment}))
    with pytest.raises(DamagedFile, match=r"times\.json is damaged or of another version \(began: "):
        run_times.read(run)
