"""A script that starts a module or a script in this process, and gives it limits once it has imported what it needs.

What a process reserves before it reads anything depends on the machine: libraries start a thread for each processor.
The limits hold for what it uses for its input. It imports nothing of this package, so that it starts quickly. It
takes the arguments of `limited_process.run`. It prints READY, and then calls `main` of the module or script.
"""

from __future__ import annotations

import importlib.util
import signal
import sys
from pathlib import Path
from types import ModuleType

try:
    import resource
except ImportError:  # On Windows.
    resource = None

READY = b"ready\n"
SIZE = Path("/proc/self/statm")  # Its first number is the address space of this process [pages] (Linux).


def _load(target: str) -> ModuleType:
    """The module of that name, or the script in that file."""
    if not target.endswith(".py"):
        return importlib.import_module(target)
    spec = importlib.util.spec_from_file_location("target", target)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _limit_memory(memory: int) -> None:
    """Limits the address space to what is in use now and `memory` [bytes], or less where a lower limit is set."""
    if resource is None or not SIZE.exists():
        return
    used = int(SIZE.read_text().split()[0]) * resource.getpagesize()
    limits = [limit for limit in resource.getrlimit(resource.RLIMIT_AS) if limit != resource.RLIM_INFINITY]
    lowest = min([used + memory, *limits])
    resource.setrlimit(resource.RLIMIT_AS, (lowest, lowest))


def _limit_time(seconds: float) -> None:
    """Ends this process after `seconds`, whatever it does."""
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, seconds)


if __name__ == "__main__":
    name, memory, seconds, *arguments = sys.argv[1:]
    loaded = _load(name)
    sys.stdout.buffer.write(READY)
    sys.stdout.buffer.flush()
    _limit_memory(int(memory))
    _limit_time(float(seconds))
    sys.exit(loaded.main(*arguments))
