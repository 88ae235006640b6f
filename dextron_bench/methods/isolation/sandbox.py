"""The command around an agent's process: limits on memory and files, and a sandbox if bubblewrap is installed.

In the sandbox there is no network and no other process. The agent can write only in its own folder. It can read only
programs, Python's files, its own files, and this package without the files of settings and experts.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

PROGRAMS = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/etc/ld.so.cache", "/etc/alternatives")
SECRET = ("splits", "experts", "real", "synthetic")  # The package's data files that begin so hold settings or experts.
LARGEST_FILE = 256 * 2**20  # [bytes] of a file that an agent may write; its stderr is one such file.
LIMITS = 'ulimit -c 0; ulimit -d "$1" && ulimit -f "$2" && shift 2 && exec "$@"'


def wrap(command: Sequence[str], scratch: str, readable: Sequence[str], memory: int) -> list[str]:
    """The command with limits on memory and files [bytes], in a sandbox if one is available."""
    limited = ["/bin/sh", "-c", LIMITS, "agent", str(memory // 1024), str(LARGEST_FILE // 512), *command]
    if not Path("/bin/sh").exists():
        return list(command)
    return [*_bubblewrap(scratch, readable), *limited] if is_available() else limited


@cache
def is_available() -> bool:
    """True if bubblewrap is installed and works on this system; runs it once."""
    if not shutil.which("bwrap"):
        return False
    mounts = ["--ro-bind", "/", "/", "--proc", "/proc", "--dev", "/dev"]
    command = ["bwrap", "--unshare-all", *mounts, "/bin/sh", "-c", ":"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def secret_files() -> list[Path]:
    """The package's files of settings, experts and reaches."""
    data = Path(__file__).resolve().parents[2] / "data"
    return sorted(file for file in data.iterdir() if file.name.startswith(SECRET))


def _bubblewrap(scratch: str, readable: Sequence[str]) -> list[str]:
    package = Path(__file__).resolve().parents[2]
    installed = {entry for entry in sys.path if "-packages" in entry and Path(entry).exists()}
    code = (str(package), str(package.parent / "baselines"))
    paths = [*PROGRAMS, sys.base_prefix, sys.prefix, *sorted(installed), *code]
    command = ["bwrap", "--unshare-all", "--die-with-parent", "--new-session", "--proc", "/proc", "--dev", "/dev"]
    command += ["--tmpfs", "/tmp"]
    for path in [*paths, *readable]:
        command += ["--ro-bind-try", path, path]
    for file in secret_files():
        command += ["--ro-bind", "/dev/null", str(file)]
    return [*command, "--bind", scratch, scratch, "--chdir", scratch, "--"]
