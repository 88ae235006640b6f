"""Files of recordings: written atomically, with errors in one line, and without threads left behind."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from dextron_bench import recording
from tests.recording.test_episode_file import PATH, episode


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "episode.rrd"


KILLED = """
import os, signal, sys
from pathlib import Path
from typing import Any
sys.path.insert(0, sys.argv[1])
from tests.recording import test_episode_file as tests
os.fsync = lambda file: os.kill(os.getpid(), signal.SIGKILL)
tests.recording.write(Path(sys.argv[2]), tests.episode(3), tests.PATH, {})
"""


def test_a_failed_write_keeps_the_old_file(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording.write(file, episode(2), PATH, {})
    before = file.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(recording.UnwritableRecording, match=r"cannot write recording .*episode\.rrd: No space left"):
        recording.write(file, episode(3), PATH, {})
    assert file.read_bytes() == before
    assert os.listdir(file.parent) == [file.name]


@pytest.mark.slow
def test_a_killed_writer_leaves_no_incomplete_recording(file: Path) -> None:
    process = subprocess.run([sys.executable, "-c", KILLED, str(Path(__file__).parents[2]), str(file)], check=False)
    assert process.returncode == -signal.SIGKILL
    assert not file.exists()
    assert list(file.parent.glob("*.rrd")) == []


def test_a_folder_that_cannot_be_made_is_an_error_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(recording.UnwritableRecording) as caught:
        recording.write(tmp_path / "taken" / "episode.rrd", episode(2), PATH, {})
    assert "taken" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(os.geteuid() == 0, reason="root can write anywhere")
def test_a_folder_without_permission_is_an_error_in_one_line(tmp_path: Path) -> None:
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    with pytest.raises(recording.UnwritableRecording, match="Permission denied"):
        recording.write(tmp_path / "episode.rrd", episode(2), PATH, {})


def test_rerun_switched_off_is_an_error_and_not_an_empty_file(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(recording.UnwritableRecording, match="RERUN"):
        recording.write(file, episode(2), PATH, {})
    assert os.listdir(file.parent) == []


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="only Linux lists threads in /proc")
def test_recordings_leave_no_threads_behind(file: Path) -> None:
    counts = []
    for _ in range(3):
        recording.write(file, episode(2), PATH, {})
        counts.append(len(os.listdir("/proc/self/task")))
    assert counts[0] == counts[1] == counts[2]
