"""What an agent's process may not do: see the simulator or the splits, write outside its folder, reach others.

A hook on Python's own audit events stops what an agent tries and says what it was. It is no boundary against code that
means harm, which can take the hook apart: that is what `sandbox` is for (docs/leaderboard.md).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dextron_bench.methods.isolation import sandbox
from dextron_bench.world import model

PUBLIC = {  # Modules of the benchmark that agents may import, with what those need.
    *("dextron_bench", "dextron_bench.experts", "dextron_bench.experts.policies"),
    *("dextron_bench.methods", "dextron_bench.methods.exact", "dextron_bench.methods.learners"),
    *("dextron_bench.reaches", "dextron_bench.reaches.reach", "dextron_bench.reaches.rotation"),
    *("dextron_bench.storage", *(f"dextron_bench.storage.{name}" for name in ("atomic", "hashing", "tensors"))),
    *("dextron_bench.success", "dextron_bench.success.network"),
    *("dextron_bench.world", "dextron_bench.world.model", "dextron_bench.world.task"),
}
SIMULATORS = ("mujoco", "dm_control")
NETWORK = ("socket.connect", "socket.bind", "socket.send", "socket.getaddrinfo", "socket.gethostby")
DATABASE = "sqlite3.connect"  # Whoever has one may attach any file to it.
STARTING = ("subprocess.", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "os.kill", "pty.")
DIGGING = ("gc.get_", "sys._current_frames", "resource.")
LISTING = ("os.listdir", "os.scandir")
CHANGING = (  # Their arguments are paths, numbers, and last where there are any, folders by descriptor.
    *("os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.symlink", "os.truncate", "os.mkfifo"),
    *("os.chmod", "os.chown", "os.utime", "os.setxattr", "shutil.rmtree", "shutil.move"),
)
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
DEVICES = ("/dev/null", "/dev/urandom", "/dev/random", "/proc/cpuinfo", "/proc/meminfo", "/proc/self", "/sys/devices")


class NotForAgents(PermissionError):
    """What an agent tried and may not."""

    def __init__(self, what: str) -> None:
        super().__init__(f"agents may not {what}")


def close(own: Sequence[Path], scratch: Path) -> None:
    """From now on this process reads only Python's own files and those in `own`, and writes only below `scratch`."""
    hide()
    package = Path(__file__).resolve().parents[2]
    places = {sys.prefix, sys.base_prefix, sys.exec_prefix, *(entry for entry in sys.path if "-packages" in entry)}
    allowed = [*places, *DEVICES, "/usr", "/lib", "/lib64", "/etc", package, package.parent / "baselines", *own]
    hidden = [str(file) for file in sandbox.secrets()]
    sys.addaudithook(_Guard([os.path.realpath(place) for place in allowed], os.path.realpath(scratch), hidden))


def hide() -> None:
    """Takes the simulator out of this process's sight; what pure functions on states need of it is kept."""
    for prepared in (model.proximal, model.command_gain, model.half_closed, model.state_names):
        prepared()
    model.load = model.mujoco = None  # type: ignore[assignment]
    for name in list(sys.modules):
        if _is_hidden(name):
            parent, _, last = name.rpartition(".")
            if parent and hasattr(sys.modules.get(parent), last):
                delattr(sys.modules[parent], last)
            del sys.modules[name]


def _is_hidden(name: str) -> bool:
    top = name.partition(".")[0]
    own = name.startswith("dextron_bench.methods.isolation") or name == "dextron_bench.methods.loading"
    return top in SIMULATORS or (top == "dextron_bench" and name not in PUBLIC and not own)


class _Guard:
    """The hook; raises NotForAgents."""

    def __init__(self, allowed: Sequence[str], scratch: str, secrets: Sequence[str]) -> None:
        self._allowed, self._scratch, self._secrets = tuple(allowed), scratch, frozenset(secrets)

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "import" and _is_hidden(arguments[0]):
            raise NotForAgents(f"import {arguments[0]}, by which the simulator and the splits are reached")
        if event == "open":
            self._check_open(*arguments)
        elif event in CHANGING:
            self._check_change(arguments, event)
        elif event in LISTING and _is_path(arguments[0]):
            self._check_read(os.path.realpath(os.fsdecode(arguments[0])))
        elif event.startswith(NETWORK):
            raise NotForAgents(f"use the network ({event})")
        elif event == DATABASE:
            raise NotForAgents("open databases, which write where they like")
        elif event.startswith(STARTING):
            raise NotForAgents(f"start or signal processes ({event})")
        elif event.startswith(DIGGING):
            raise NotForAgents(f"search the process they run in ({event})")

    def _check_open(self, path: Any, mode: str | None, flags: int) -> None:
        if not _is_path(path):
            return  # A file descriptor.
        place = os.path.realpath(os.fsdecode(path))
        if mode is None and os.path.isdir(place) and not _within(place, self._scratch):
            raise NotForAgents(f"open the folder {place}, from which files can be opened unseen")
        if flags & WRITING and place != "/dev/null" and not _within(place, self._scratch):
            raise NotForAgents(f"write {place}: only the folder they are started in is theirs")
        self._check_read(place)

    def _check_read(self, place: str) -> None:
        if place in self._secrets:
            raise NotForAgents(f"read {place}: settings and experts are not for agents")
        if not any(_within(place, each) for each in (*self._allowed, self._scratch)):
            raise NotForAgents(f"read {place}: only Python's files and their own folder are theirs")

    def _check_change(self, arguments: tuple[Any, ...], event: str) -> None:
        places = [os.path.realpath(os.fsdecode(path)) for path in arguments if _is_path(path)]
        beside = [each for each in arguments[-1:] if type(each) is int and each >= 0 and event != "os.truncate"]
        if beside or not all(_within(place, self._scratch) for place in places):
            raise NotForAgents(f"change files outside the folder they are started in ({event} {' '.join(places)})")


def _is_path(value: Any) -> bool:
    return isinstance(value, str | bytes | os.PathLike)


def _within(place: str, folder: str) -> bool:
    return place == folder or place.startswith(folder.rstrip("/") + "/")
