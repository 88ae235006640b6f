"""Recordings that are written beside the rollout: as in one process, and no process stays or hangs."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from dextron_bench import recording
from dextron_bench.errors import Failed
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.recording.rrd_file import UnwritableRecording
from dextron_bench.runs import recorder
from dextron_bench.runs.recorder import Recorder
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
        yield started
    assert not multiprocessing.active_children()


def write_all(writer: Recorder, folder: Path) -> dict[str, str]:
    for k, case in enumerate(CASES):
        writer.write(folder / f"{k}.rrd", case, EPISODES[k], {"row": k})
    return {file.name: sha256 for file, sha256 in writer.hashes().items()}


@pytest.mark.slow
def test_processes_write_what_this_process_writes(tmp_path: Path, two: Recorder, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(recorder, "AHEAD", 1)  # The third recording waits for the first one.
    (tmp_path / "beside").mkdir()
    (tmp_path / "here").mkdir()
    beside = write_all(two, tmp_path / "beside")
    assert len(multiprocessing.active_children()) == 2
    with Recorder(SOURCE, len(CASES), threads=1) as alone:
        here = write_all(alone, tmp_path / "here")
    assert list(beside) == list(here) == ["0.rrd", "1.rrd", "2.rrd", "3.rrd"]
    for name in here:
        one, other = (
            recording.read(tmp_path / place / name, sha[name]) for place, sha in (("beside", beside), ("here", here))
        )
        assert one.properties == other.properties
        assert (one.episode.states == other.episode.states).all()


@pytest.mark.slow
def test_a_recording_that_cannot_be_written_is_named(tmp_path: Path, two: Recorder):
    (tmp_path / "taken").write_text("")
    two.write(tmp_path / "taken" / "0.rrd", CASES[0], EPISODES[0], {})
    two.write(tmp_path / "1.rrd", CASES[1], EPISODES[1], {})
    with pytest.raises(UnwritableRecording, match=r"cannot write recording .*/taken/0.rrd: File exists"):
        two.hashes()
    assert list(two.hashes()) == [tmp_path / "1.rrd"]  # The process goes on.


@pytest.mark.slow
def test_a_process_that_was_killed_is_named(tmp_path: Path, two: Recorder):
    write_all(two, tmp_path)
    for process in multiprocessing.active_children():
        process.kill()
        process.join()
    with pytest.raises(Failed, match=r"has ended; run the command again, with --threads 1"):
        write_all(two, tmp_path)


@pytest.mark.slow
def test_an_error_of_the_rollout_ends_all_processes_after_what_they_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(recorder, "EACH", 1)
    two = Recorder(SOURCE, 2, threads=2)

    def stop() -> None:
        with two:
            for k, case in enumerate(CASES):
                two.write(tmp_path / f"{k}.rrd", case, EPISODES[k], {"row": k})
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stop()
    assert not multiprocessing.active_children()
    assert not list(tmp_path.glob(".*.part"))  # No part of a file is left.


PROGRAM = """
import signal, sys, time
from pathlib import Path
signal.signal(signal.SIGINT, signal.default_int_handler)  # A shell's job in the background would ignore it.
sys.path.insert(0, {root!r})
from dextron_bench.runs import recorder
from tests.runs.test_recorder import CASES, EPISODES, SOURCE
if __name__ == "__main__":
    recorder.EACH = 1
    with recorder.Recorder(SOURCE, 2, threads=2) as two:
        two.write(Path("0.rrd"), CASES[0], EPISODES[0], {{}})
        two.hashes()
        import multiprocessing
        print(*(child.pid for child in multiprocessing.active_children()), flush=True)
        time.sleep(60)
"""


@pytest.mark.slow
@pytest.mark.parametrize("sent", [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.thorough)])
def test_processes_end_silently_with_the_one_that_started_them(tmp_path: Path, sent: signal.Signals):
    """Ctrl-C goes to all processes of a terminal; the only traceback is of the first one, whose command catches it."""
    (tmp_path / "program.py").write_text(PROGRAM.format(root=str(Path(__file__).parents[2])))
    command = [sys.executable, "-P", "program.py"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=tmp_path, start_new_session=True, **pipes) as program:
        assert program.stdout
        assert program.stderr
        assert len(program.stdout.readline().split()) > 0
        if sent == signal.SIGINT:
            os.killpg(program.pid, sent)
        else:
            program.kill()
        errors = program.stderr.read()  # Until the last process that could write to it has ended.
    if sent == signal.SIGINT:
        assert errors.startswith('Traceback (most recent call last):\n  File "'), errors
        assert errors.count("Traceback") == 1, errors
    else:
        assert not errors


@pytest.mark.parametrize(
    ("count", "threads", "processes"), [(23, 8, 0), (24, 8, 2), (40, 8, 3), (500, 3, 3), (500, 1, 0), (0, 8, 0)]
)
def test_each_process_has_twelve_recordings_or_more(
    monkeypatch: pytest.MonkeyPatch, count: int, threads: int, processes: int
):
    started = list[tuple[object, int]]()
    monkeypatch.setattr(recorder, "_pool", lambda *of: started.append(of))
    Recorder(SOURCE, count, threads)
    assert started == ([(SOURCE, processes)] if processes else [])
