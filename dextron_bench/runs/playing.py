"""Which runs play episodes at this moment, and how far they are, for a process that looks at the folder of runs.

A run that plays holds the lock of a small file. The system releases the lock when the process ends, however it ends.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from dextron_bench.storage.progress import Progress
from dextron_bench.storage.run_folder import RunFolder

try:
    import fcntl
except ImportError:  # Elsewhere than on POSIX systems, no run is known to play.
    fcntl = None

FILE = ".playing"  # In the folder of the run; hidden, so that no reader takes it for a part of the run.
PERIOD = 1.0  # [s] at least between two updates of the file.
LONGEST = 100  # Characters of the file that are read.


@contextmanager
def shown(folder: RunFolder, report: Progress) -> Iterator[Progress]:
    """While the block lasts, other processes can see that the run plays; yields a Progress for its episodes."""
    if fcntl is None:
        yield report
        return
    file, written = folder.path / FILE, 0.0

    def report_and_show(done: int, total: int, note: str = "") -> None:
        nonlocal written
        if time.monotonic() - written >= PERIOD:
            written = time.monotonic()
            with suppress(OSError):  # A full disk stops nothing here.
                file.write_text(f"{done} of {total} episodes", encoding="ascii")
        report(done, total, note)

    with file.open("a") as lock:
        with suppress(BlockingIOError):  # Several processes may play the same run.
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        try:
            yield report_and_show
        finally:
            file.unlink(missing_ok=True)


def state(folder: RunFolder) -> str:
    """How far a run is that plays at this moment, such as "120 of 200 episodes"; empty if it does not play."""
    if fcntl is None:
        return ""
    with suppress(OSError), (folder.path / FILE).open(encoding="ascii", errors="replace") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return lock.read(LONGEST) or "0 episodes"
    return ""
