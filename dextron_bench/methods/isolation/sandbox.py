"""What an agent's process is put into: limits of its own, and, where bubblewrap is installed, a world without the rest.

Inside there is no network, no other process, nothing to write but the agent's folder, and nothing to read but programs,
Python's files, the benchmark less what tells of settings, and the agent's own files.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

PROGRAMS = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/etc/ld.so.cache", "/etc/alternatives")
SECRET = (
    "splits",
    "experts",
    "real",
    "synthetic",
)  # What names of the package's data begin with that tell of settings.
LARGEST = 256 * 2**20  # [bytes] of a file that an agent may write, what it says to stderr included.
LIMITS = 'ulimit -c 0; ulimit -d "$1" && ulimit -f "$2" && shift 2 && exec "$@"'


def wrap(words: Sequence[str], scratch: str, own: Sequence[str], memory: int) -> list[str]:
    """The command with limits on memory and files [bytes], in a sandbox where there is one."""
    limited = ["/bin/sh", "-c", LIMITS, "agent", str(memory // 1024), str(LARGEST // 512), *words]
    if not Path("/bin/sh").exists():
        return list(words)
    return [*_sandbox(scratch, own), *limited] if is_here() else limited


@cache
def is_here() -> bool:
    """Whether bubblewrap is installed and may make what it is asked for."""
    if not shutil.which("bwrap"):
        return False
    words = ["bwrap", "--unshare-all", "--ro-bind", "/", "/", "--proc", "/proc", "--dev", "/dev", "/bin/sh", "-c", ":"]
    return subprocess.run(words, capture_output=True, check=False).returncode == 0


def secrets() -> list[Path]:
    """Files of the package that tell of settings, experts and reaches."""
    data = Path(__file__).resolve().parents[2] / "data"
    return sorted(file for file in data.iterdir() if file.name.startswith(SECRET))


def _sandbox(scratch: str, own: Sequence[str]) -> list[str]:
    package = Path(__file__).resolve().parents[2]
    installed = {entry for entry in sys.path if "-packages" in entry and Path(entry).exists()}
    places = [
        *PROGRAMS,
        sys.base_prefix,
        sys.prefix,
        *sorted(installed),
        str(package),
        str(package.parent / "baselines"),
    ]
    words = ["bwrap", "--unshare-all", "--die-with-parent", "--new-session", "--proc", "/proc", "--dev", "/dev"]
    words += ["--tmpfs", "/tmp"]
    for place in [*places, *own]:
        words += ["--ro-bind-try", place, place]
    for file in secrets():
        words += ["--ro-bind", "/dev/null", str(file)]
    return [*words, "--bind", scratch, scratch, "--chdir", scratch, "--"]
