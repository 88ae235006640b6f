"""A tracker's own process: follows a training until its standard input ends, which `launch` closes after the training.

So it also ends if the process that trains is killed.
"""

from __future__ import annotations

import os
import shutil
import sys
import threading
import time
from pathlib import Path

from dextron_bench.tracking import live, trackers
from dextron_bench.tracking.follower import PENDING, POLL, Counts, Follower
from dextron_bench.tracking.launch import GRACE, LIVE, MARGIN, counts_file
from dextron_bench.tracking.training_files import TrainingFiles
from dextron_bench.training import loop

NICE = 10  # Lower priority than the training on a busy machine.


def main(name: str, folder: Path, into: Path, grace: float) -> None:
    """Follows the training in `folder`; files go `into` a folder, counts beside it.

    After the training it takes `grace` [s] at most to show the rest.
    """
    ended = _EndOfInput(None if name == LIVE else grace + MARGIN)
    files = TrainingFiles(folder, loop.seeds_of(folder))
    shutil.rmtree(into, ignore_errors=True)  # It is written anew, from the first epoch on: nothing is there twice.
    while not files.config() and not ended.is_set():  # The training writes it first.
        time.sleep(POLL)
    try:
        _follow(name, files, into, ended, grace)
    except Exception as error:
        Counts(error=f"{type(error).__name__}: {' '.join(str(error).split())}").write(counts_file(into))
        raise


def _follow(name: str, files: TrainingFiles, into: Path, ended: _EndOfInput, grace: float) -> None:
    def note(counts: Counts) -> None:
        counts.write(counts_file(into))

    if name == LIVE:
        live.watch([files], ended.is_set, note)
        return
    pending = PENDING if grace <= GRACE else sys.maxsize  # A training that is over does not outrun the tracker.
    follower = Follower(files, trackers.create(name, files, into), pending)
    follower.run(ended.is_set, lambda: ended.seconds > grace, note)


class _EndOfInput(threading.Thread):
    """Notices when the standard input ends."""

    def __init__(self, limit: float | None) -> None:
        """Ends this process `limit` [s] after the input, in case the tracker hangs; None never ends it."""
        super().__init__(daemon=True)
        self._time, self._limit = 0.0, limit
        self.start()

    def run(self) -> None:
        """Reads until there is no more."""
        while sys.stdin.buffer.read(1):
            pass
        self._time = time.monotonic()
        if self._limit is not None:
            time.sleep(self._limit)
            os._exit(1)

    def is_set(self) -> bool:
        """True if the input has ended."""
        return self._time > 0.0

    @property
    def seconds(self) -> float:
        """Time since the end [s]; 0 before."""
        return time.monotonic() - self._time if self._time else 0.0


if __name__ == "__main__":
    if hasattr(os, "nice") and sys.argv[1] != LIVE:  # A window must answer its user.
        os.nice(NICE)
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]), float(sys.argv[4]))
