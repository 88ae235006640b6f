"""Python code in a process of its own, with limits on memory and time.

It reads files that may come from strangers: a few bytes of such a file can state sizes that fill the memory, or abort
the process that decodes them.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass

from dextron_bench.storage import programs

GIBIBYTE = 2**30  # [bytes]
SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
START = """
import runpy, sys
kind, target, memory, *sys.argv[1:] = sys.argv[1:]
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
except (ImportError, OSError, ValueError):
    pass
if kind == "module":
    runpy.run_module(target, run_name="__main__", alter_sys=True)
else:
    runpy.run_path(target, run_name="__main__")
"""


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
    """Runs a module, or a script if `target` ends in .py, with `content` on its standard input.

    It may use `memory` [bytes] of address space, where the system supports that limit, and `seconds` of time.
    """
    kind = "script" if target.endswith(".py") or "." not in target else "module"
    command = programs.python("-c", START, kind, target, str(memory), *arguments)
    environment = {**os.environ, **SINGLE_THREADED}
    try:
        done = subprocess.run(
            command, input=content, capture_output=True, timeout=seconds, env=environment, check=False
        )
    except subprocess.TimeoutExpired as error:
        return Outcome(error.stdout or b"", (error.stderr or b"").decode(errors="replace"), None)
    return Outcome(done.stdout, done.stderr.decode(errors="replace"), done.returncode)
