"""Python code in a process of its own, with limits on memory and time.

It reads files that may come from strangers: a few bytes of such a file can state sizes that fill the memory, or abort
the process that decodes them.
"""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass

from dextron_bench.errors import Failed
from dextron_bench.processes import limited_start, programs
from dextron_bench.processes.limited_start import READY

try:
    import resource
except ImportError:  # On Windows.
    resource = None

GIBIBYTE = 2**30  # [bytes]
SINGLE_THREADED = {
    **dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "RAYON_NUM_THREADS"), "1"),
    "ARROW_DEFAULT_MEMORY_POOL": "system",
    "MALLOC_ARENA_MAX": "2",  # Arenas: 64 MiB reserved for each thread.
}
START = 600.0  # [s] in which a process must import what it needs, also from a slow disk.
WORDS = 30  # The last words of the process's errors that a message has.


class NotStarted(Failed):
    """A process that has ended before it could read anything: the machine lacks something, and no file is at fault."""

    def __init__(self, errors: str) -> None:
        reason = " ".join(errors.split()[-WORDS:]) or "it took too long"
        super().__init__(f"the process that reads files cannot start: {reason}{memory_advice()}")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a process wrote, and how it ended: its exit code, or None if its time was up."""

    output: bytes
    errors: str
    code: int | None

    @property
    def ending(self) -> str:
        """How the process ended, in words."""
        return "took too long" if self.code is None else f"ended with code {self.code}"


def run(target: str, arguments: Sequence[str], content: bytes, memory: int, seconds: float) -> Outcome:
    """Calls `main` of a module, or of a script if `target` ends in .py, with `content` on its standard input.

    It may use `memory` [bytes] of address space more than after its imports (Linux), and `seconds` of time. Raises
    NotStarted if the imports fail.
    """
    command = programs.python(limited_start.__file__, target, str(memory), str(seconds), *arguments)
    environment = {**os.environ, **SINGLE_THREADED}
    try:
        done = subprocess.run(
            command, input=content, capture_output=True, timeout=START + seconds, env=environment, check=False
        )
    except subprocess.TimeoutExpired as error:
        return _outcome(error.stdout or b"", error.stderr or b"", None)
    is_time_up = os.name == "posix" and done.returncode == -signal.SIGALRM
    return _outcome(done.stdout, done.stderr, None if is_time_up else done.returncode)


def _outcome(output: bytes, errors: bytes, code: int | None) -> Outcome:
    text = errors.decode(errors="replace")
    if not output.startswith(READY):
        raise NotStarted(text)
    return Outcome(output.removeprefix(READY), text, code)


def memory_advice() -> str:
    """What may help if this process has a limit on its address space, empty if it has none."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0] if resource else -1
    if not resource or limit == resource.RLIM_INFINITY:
        return ""
    return f" (`ulimit -v` allows {limit / GIBIBYTE:.1f} GiB of address space; raise it)"
