"""Which runs play episodes at this moment, and how far they are, for a process that looks at the folder of runs.

A run that plays holds a lock, which shows how far it is, and which ends with the process, however it ends.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

from dextron_bench.storage import locks
from dextron_bench.storage.progress import Progress
from dextron_bench.storage.run_folder import RunFolder

FILE = ".plays"  # In the folder of the run; hidden, so that no reader takes it for a part of the run.
PERIOD = 1.0  # [s] at least between two updates of the file.


@contextmanager
def shown(folder: RunFolder, report: Progress) -> Iterator[Progress]:
    """While the block lasts, other processes can see that the run plays; yields a Progress for its episodes.

    Several processes may play the same run. One is seen, and after its end another one.
    """
    file, written, say = folder.path / FILE, 0.0, None

    def report_and_show(done: int, total: int, note: str = "") -> None:
        nonlocal written, say
        if time.monotonic() - written >= PERIOD:
            written = time.monotonic()
            if say is None:
                with suppress(OSError, locks.Held):
                    say = lock.enter_context(locks.held(file))
            if say is not None:
                say(f"{done} of {total} episodes")
        report(done, total, note)

    with ExitStack() as lock:
        with suppress(OSError, locks.Held):
            say = lock.enter_context(locks.held(file))
        yield report_and_show


def state(folder: RunFolder) -> str:
    """How far a run is that plays at this moment, such as "120 of 200 episodes"; empty if it does not play."""
    shown = locks.text(folder.path / FILE)
    return "" if shown is None else shown or "0 episodes"
