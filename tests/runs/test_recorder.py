"""Recordings that are written beside the rollout: as in one process, and no process stays or hangs."""

from __future__ import annotations

import os
import pickle
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from dextron_bench import recording
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.recording.rrd_file import UnwritableRecording
from dextron_bench.runs import recorder
from dextron_bench.runs.recorder import LostProcess, Recorder
from tests.helpers.short_reaches import SETTINGS, SOURCE, actions, played

CASES = [Case(setting, Expert(1.2, 0.3), 0.1) for setting in SETTINGS[:4]]


def episode(k: int) -> Episode:
    whole = played(k)
    taken = actions(k)[: len(whole.rewards)]
    return Episode(SETTINGS[k], whole.states, taken, whole.rewards, whole.terminated, whole.truncated, "")


EPISODES = [episode(k) for k in range(len(CASES))]


@pytest.fixture
def two(monkeypatch: pytest.MonkeyPatch) -> Iterator[Recorder]:
    """A recorder with two processes."""
    monkeypatch.setattr(recorder, "EACH", 1)
    with Recorder(SOURCE, 2, threads=2) as started:
        assert len(started._processes) == 2
        yield started
    assert all(process._popen.returncode is not None for process in started._processes)


def write_all(writer: Recorder, folder: Path) -> dict[str, str]:
    for k, case in enumerate(CASES):
        writer.write(folder / f"{k}.rrd", case, EPISODES[k], {"row": k})
    return {file.name: sha256 for file, sha256 in writer.hashes().items()}


def test_processes_write_what_this_process_writes(tmp_path: Path, two: Recorder, monkeypatch: pytest.MonkeyPatch):
    assert os.getsid(two._processes[0]._popen.pid) != os.getsid(0)  # Ctrl-C in a terminal does not reach it.
    monkeypatch.setattr(recorder, "AHEAD", 1)  # The third recording waits for the first one.
    (tmp_path / "beside").mkdir()
    (tmp_path / "here").mkdir()
    beside = write_all(two, tmp_path / "beside")
    with Recorder(SOURCE, len(CASES), threads=1) as alone:
        assert not alone._processes
        here = write_all(alone, tmp_path / "here")
    assert list(beside) == list(here) == ["0.rrd", "1.rrd", "2.rrd", "3.rrd"]
    for name in here:
        one, other = (
            recording.read(tmp_path / place / name, sha[name]) for place, sha in (("beside", beside), ("here", here))
        )
        assert one.properties == other.properties
        assert (one.episode.states == other.episode.states).all()


def test_a_recording_that_cannot_be_written_is_named(tmp_path: Path, two: Recorder):
    (tmp_path / "taken").write_text("")
    two.write(tmp_path / "taken" / "0.rrd", CASES[0], EPISODES[0], {})
    two.write(tmp_path / "1.rrd", CASES[1], EPISODES[1], {})
    with pytest.raises(UnwritableRecording, match=r"cannot write recording .*/taken/0.rrd: File exists"):
        two.hashes()
    assert list(two.hashes()) == [tmp_path / "1.rrd"]  # The process goes on.


def test_a_process_that_was_killed_is_named(tmp_path: Path, two: Recorder):
    for process in two._processes:
        process._popen.kill()
        process._popen.wait()
    two.write(tmp_path / "0.rrd", CASES[0], EPISODES[0], {})
    with pytest.raises(LostProcess, match=r"has ended \(code -9\); run the command again, with --threads 1"):
        two.hashes()


def test_an_error_of_the_rollout_ends_all_processes_after_what_they_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(recorder, "EACH", 1)
    two = Recorder(SOURCE, 2, threads=2)

    def stop() -> None:
        with two:
            for k, case in enumerate(CASES):
                two.write(tmp_path / f"{k}.rrd", case, EPISODES[k], {})
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stop()
    assert [process._popen.returncode for process in two._processes] == [0, 0]
    assert not list(tmp_path.glob(".*.part"))  # No part of a file is left.


@pytest.mark.parametrize("cut", [0, 100, -100], ids=["nothing", "part-of-the-source", "part-of-a-recording"])
def test_a_process_ends_silently_if_the_other_one_is_killed(tmp_path: Path, cut: int):
    """Its input ends wherever the other process was, and nobody reads the answer to the recording before that."""
    job = (tmp_path / "0.rrd", CASES[0], EPISODES[0], {})
    content = b"".join(map(pickle.dumps, (SOURCE, job, job)))
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(recorder.COMMAND, input=content[:cut], stdout=writing, stderr=subprocess.PIPE, timeout=60)
    os.close(writing)
    assert (done.returncode, done.stderr, (tmp_path / "0.rrd").exists()) == (0, b"", cut < 0)


@pytest.mark.parametrize(
    ("count", "threads", "processes"), [(23, 8, 0), (24, 8, 2), (40, 8, 3), (500, 3, 3), (500, 1, 0), (0, 8, 0)]
)
def test_each_process_has_twelve_recordings_or_more(
    monkeypatch: pytest.MonkeyPatch, count: int, threads: int, processes: int
):
    started = list[object]()
    monkeypatch.setattr(recorder, "_Process", started.append)
    Recorder(SOURCE, count, threads).__enter__()
    assert started == [SOURCE] * processes
