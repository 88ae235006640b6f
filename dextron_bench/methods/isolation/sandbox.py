"""The command around an agent's process: limits on memory and files, and a sandbox if bubblewrap is installed.

In the sandbox there is no network and no other process. The agent can write only in its own folder, which is in memory,
has a fixed size and is empty at each start. It can read only programs, Python's files, its own files, and the public
modules of this package. The simulator, the splits and the experts are not there. An installed method may read all of
this package's code, since the user has chosen to install it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from dextron_bench.processes import programs

# Parts of /usr and /usr/local, and of Python's prefix: other folders there may hold a project with results and splits.
PARTS = ("bin", "sbin", "lib", "lib32", "lib64", "libexec", "share")
PYTHON = ("bin", "lib", "lib64", "pyvenv.cfg")
PROGRAMS = (
    *(f"/usr/{part}" for part in PARTS),
    *(f"/usr/local/{part}" for part in PARTS),
    "/bin",
    "/sbin",
    "/lib",
    "/lib32",
    "/lib64",
    "/etc/ld.so.cache",
    "/etc/alternatives",
)
PROGRAM = "bwrap"
SIMULATORS = ("mujoco", "dm_control")  # Packages that are hidden.
SYSTEM_LIBRARIES = ("/usr/lib", "/usr/local/lib")  # Where other interpreters have packages.
# The package's data files and folders that begin so hold settings, experts, reaches or published episodes.
SECRET = ("splits", "experts", "real", "synthetic", "results")
LARGEST_FILE = 256 * 2**20  # [bytes] of a file that an agent may write; its stderr is one such file.
NAMESPACES = ("--unshare-all", "--cap-drop", "ALL", "--unshare-user", "--disable-userns")  # Last two: bubblewrap 0.8.
# A limit of the user that is lower stays: nobody may raise it, and the shell would end.
LIMITS = """
limit() { hard=$(ulimit -H "$1"); { [ "$hard" != unlimited ] && [ "$hard" -le "$2" ]; } || ulimit "$1" "$2"; }
ulimit -c 0; limit -n 512; limit -d "$1" && limit -f "$2" && shift 2 && exec "$@"
"""


def wrap(
    command: Sequence[str], scratch: str, readable: Sequence[str], memory: int, disk: int, public: Sequence[Path] = ()
) -> list[str]:
    """The command with limits on memory and on files in `scratch` [bytes], in a sandbox if one is available.

    Without a sandbox, `Process` measures the files. `public` are the files of this package that the sandbox has; if
    there are none, it has the package, and the simulator too.
    """
    limited = ["/bin/sh", "-c", LIMITS, "agent", str(memory // 1024), str(LARGEST_FILE // 512), *command]
    if not Path("/bin/sh").exists():
        return list(command)
    return [*_bubblewrap(scratch, readable, disk, public), *limited] if is_available() else limited


@cache
def is_available() -> bool:
    """True if bubblewrap is installed and works on this system; runs it once."""
    return bool(_namespaces())


@cache
def _namespaces() -> tuple[str, ...]:
    """The strictest options for namespaces with which bubblewrap works on this system; empty if there are none."""
    if not (program := programs.find(PROGRAM)):
        return ()
    mounts = ["--ro-bind", "/", "/", "--proc", "/proc", "--dev", "/dev", "--remount-ro", "/dev"]
    for options in (NAMESPACES, NAMESPACES[:3]):
        command = [program, *options, *mounts, "/bin/sh", "-c", ":"]
        if subprocess.run(command, capture_output=True, check=False).returncode == 0:
            return options
    return ()


def secret_files() -> list[Path]:
    """The package's files of settings, experts and reaches, and the folder of published results in a wheel."""
    data = Path(__file__).resolve().parents[2] / "data"
    return sorted(file for file in data.iterdir() if file.name.startswith(SECRET))


def _bubblewrap(scratch: str, readable: Sequence[str], disk: int, public: Sequence[Path]) -> list[str]:
    """Folders first, then what hides parts of them, then files; at last, all that is left becomes read-only."""
    package = Path(__file__).resolve().parents[2]
    python = [f"{prefix}/{part}" for prefix in (sys.base_prefix, sys.prefix) for part in PYTHON]
    folders = [*PROGRAMS, *python, *map(str, _installed()), str(package.parent / "baselines")]
    folders += [path for path in readable if not Path(path).is_file()]
    secrets = [] if public else secret_files()
    hidden = _hidden(package) if public else [place for place in secrets if place.is_dir()]
    command = [programs.find(PROGRAM) or PROGRAM, *_namespaces(), "--die-with-parent", "--new-session"]
    command += ["--proc", "/proc", "--dev", "/dev"]
    command += ["--tmpfs", "/tmp"]
    folders = list(dict.fromkeys(folders if public else [*folders, str(package)]))
    for path in folders:
        command += _bind(path, [other for other in folders if other != path])
    for folder in hidden:
        command += ["--tmpfs", str(folder)]
    for file in [*map(str, public), *(path for path in readable if Path(path).is_file())]:
        command += ["--ro-bind-try", file, file]
    for file in secrets:
        command += ["--ro-bind", "/dev/null", str(file)] if file.is_file() else []
    command += [*_scratch(scratch, disk), "--chdir", scratch]
    for folder in (*hidden, "/tmp", "/dev", "/"):
        command += ["--remount-ro", str(folder)]
    return [*command, "--"]


def _bind(folder: str, others: Sequence[str]) -> list[str]:
    """Options for a folder that the agent may read. A link into one of the others stays a link.

    A second copy of its target would show what is hidden in the first one; `lib64` of an environment is such a link.
    """
    target = os.path.realpath(folder)
    if not os.path.islink(folder) or not any(Path(target).is_relative_to(other) for other in others):
        return ["--ro-bind-try", folder, folder]
    is_there = any(Path(folder).is_relative_to(other) for other in others)
    return [] if is_there else ["--symlink", target, folder]


def _scratch(folder: str, size: int) -> list[str]:
    """Options for the folder that the agent may write: in memory, of a fixed size [bytes].

    A size that the system enforces also counts files that cannot be seen from outside: without a name, or in a path
    that is too long. Bubblewrap before 0.8 gets the folder itself, whose files `Process` measures.
    """
    is_recent = _namespaces() == NAMESPACES
    return ["--size", str(size), "--tmpfs", folder] if is_recent else ["--bind", folder, folder]


def _installed() -> list[Path]:
    """The folders of installed packages."""
    return sorted({Path(entry) for entry in sys.path if "-packages" in entry and Path(entry).exists()})


def _hidden(package: Path) -> list[Path]:
    """The folders of this package and of the simulators, which the sandbox replaces by empty ones."""
    names = (package.name, *SIMULATORS)
    roots = [Path(sys.base_prefix, "lib"), *(Path(folder) for folder in SYSTEM_LIBRARIES)]
    others = [entry for root in roots for entry in root.glob("python3*/*-packages")]
    entries = dict.fromkeys([*_installed(), *others])
    return [package, *(place for entry in entries for name in names if (place := entry / name).is_dir())]
