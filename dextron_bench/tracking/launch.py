"""Starts a process for each tracker of a training, and says at the end what did not arrive.

Whatever happens to these processes, the training goes on: it only writes its files, as always.
"""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from dextron_bench.processes import programs
from dextron_bench.storage import records
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.run_folder import TRACKING
from dextron_bench.tracking.follower import Counts

COMMAND = programs.python("-m", "dextron_bench.tracking.process")
LIVE = "live"  # The tracker that opens a window, which stays open after the training.
GRACE = 30.0  # [s] after the training in which trackers show the rest.
PATIENCE = 3600.0  # [s] instead, for a training that was over before: nothing runs that a tracker could slow.
MARGIN = 10.0  # [s] after that in which their processes end.


@dataclass(frozen=True, slots=True)
class _Follower:
    """A tracker's process, and the folder that it writes into."""

    name: str
    into: Path
    process: subprocess.Popen[bytes]

    @property
    def input(self) -> IO[bytes]:
        """The standard input, whose end says that the training is over."""
        assert self.process.stdin is not None
        return self.process.stdin


def counts_file(into: Path) -> Path:
    """The file with the counts of the tracker that writes into a folder."""
    return into.with_name(f"{into.name}.json")


def log_file(into: Path) -> Path:
    """The file with all that a tracker prints."""
    return into.with_name(f"{into.name}.log")


@contextmanager
def following(
    folders: Sequence[Path], names: Sequence[str], say: Callable[[str], None], grace: float = GRACE
) -> Iterator[None]:
    """Follows the trainings in `folders` with trackers, in processes of their own, as long as the block lasts.

    What a tracker writes is in `tracking-<seeds>/<tracker>`, beside the folder of its training. `say` receives a line
    for each tracker at the end. The block never waits for a tracker, and after it no longer than `grace` [s].
    """
    followers, is_over = list[_Follower](), threading.Event()
    for folder in folders:
        for name in names:
            try:
                followers.append(_start(name, folder, grace))
            except OSError as error:
                say(f"tracker {name} does not run ({error}); the run goes on without it")
    for follower in followers:
        threading.Thread(target=_watch, args=(follower, is_over, say), daemon=True).start()
    try:
        yield
    except BaseException:  # Nobody waits after an error or Ctrl-C: the trackers end by themselves.
        _end_inputs(followers, is_over)
        for follower in followers:
            say(f"tracker {follower.name} shows the rest in {grace:g} s at most; counts: {counts_file(follower.into)}")
        raise
    _end_inputs(followers, is_over)
    deadline = time.monotonic() + grace + MARGIN
    for follower in followers:
        say(_outcome(follower, deadline))


def _end_inputs(followers: Sequence[_Follower], is_over: threading.Event) -> None:
    """Lets trackers know that the training is over."""
    is_over.set()
    for follower in followers:
        with suppress(OSError):
            follower.input.close()


def _watch(follower: _Follower, is_over: threading.Event, say: Callable[[str], None]) -> None:
    """Says at once if a tracker ends before its training."""
    follower.process.wait()
    if not is_over.is_set():
        say(f"tracker {follower.name} has ended ({_counts(follower).error}); the run goes on without it")


def _start(name: str, folder: Path, grace: float) -> _Follower:
    into = folder.resolve().with_name(f"{TRACKING}{folder.name.removeprefix('training-')}") / name
    into.parent.mkdir(parents=True, exist_ok=True)
    counts_file(into).unlink(missing_ok=True)
    command = [*COMMAND, name, str(folder.resolve()), str(into), str(grace)]
    with log_file(into).open("wb") as log:
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )
    return _Follower(name, into, process)


def _outcome(follower: _Follower, deadline: float) -> str:
    """What became of a tracker, in a line; ends its process if it is still there at the deadline."""
    was_killed = not _wait(follower, deadline)
    if was_killed:
        with suppress(ProcessLookupError):
            os.killpg(follower.process.pid, signal.SIGKILL)
        follower.process.wait()
    return _line(follower, _counts(follower), was_killed)


def _counts(follower: _Follower) -> Counts:
    """The counts of a tracker; of one that wrote none, zeros."""
    try:
        return records.read(counts_file(follower.into), Counts)
    except (DamagedFile, OSError):
        return Counts(error="it showed nothing")


def _wait(follower: _Follower, deadline: float) -> bool:
    """Waits for the end of a process, or until a live view has shown all; False if the deadline passes."""
    while time.monotonic() < deadline:
        if follower.process.poll() is not None:
            return True
        if follower.name == LIVE and _counts(follower).over:
            return True
        time.sleep(0.1)
    return False


def _line(follower: _Follower, counts: Counts, was_killed: bool) -> str:
    evaluations = f"{counts.evaluations} evaluation{'s' * (counts.evaluations != 1)}"
    text = f"tracker {follower.name}: {counts.points} points and {evaluations}"
    text += f" with episodes in {follower.into}" if follower.name != LIVE else " with episodes shown"
    if counts.dropped:
        text += f"; {counts.dropped} dropped ({counts.error})"
    elif counts.error:
        text += f"; {counts.error}"
    if was_killed:
        text += "; it did not end and was stopped, the rest is missing"
    elif not counts.over:
        text += f"; it ended early, see {log_file(follower.into)}"
    return text
