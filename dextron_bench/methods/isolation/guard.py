"""What the process of an agent written in Python may not do: import the simulator, read splits, write elsewhere.

A hook on Python's audit events stops forbidden actions that pass through Python's own functions, and names them. It is
no protection against malicious code: such code can disable the hook, and calls that raise no audit event, as in
compiled modules, pass it. The sandbox is the protection: in it, the files are not there at all (docs/agents.md).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from pathlib import Path
from typing import Any

from dextron_bench.methods.isolation import sandbox

PUBLIC = {  # Modules of the benchmark that agents may import, and the modules that these import (docs/agents.md).
    *("dextron_bench", "dextron_bench.experts", "dextron_bench.experts.policies"),
    *("dextron_bench.methods", *(f"dextron_bench.methods.{name}" for name in ("agents", "exact", "learners"))),
    *("dextron_bench.reaches", *(f"dextron_bench.reaches.{name}" for name in ("reach", "rotation", "timing"))),
    *("dextron_bench.storage", *(f"dextron_bench.storage.{name}" for name in ("atomic", "hashing", "tensors"))),
    *("dextron_bench.success", "dextron_bench.success.network"),
    *("dextron_bench.world", "dextron_bench.world.model", "dextron_bench.world.task"),
}
WORKER = (
    *("dextron_bench.methods.isolation", "dextron_bench.methods.loading", "dextron_bench.methods.specs"),
    "dextron_bench.processes.programs",
)
WORKER_FILES = ("worker", "guard", "policy_files", "protocol", "sandbox")  # In WORKER's first package.
NETWORK = ("socket.connect", "socket.bind", "socket.send", "socket.getaddrinfo", "socket.gethostby")
DATABASE = "sqlite3.connect"  # A database can attach any other file.
PROCESSES = ("subprocess.", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "os.kill", "pty.")
INTROSPECTION = ("gc.get_", "sys._current_frames", "resource.")
LISTING = ("os.listdir", "os.scandir")
CHANGING = (  # Arguments: paths, then numbers, then in some events the descriptors of the folders.
    *("os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.symlink", "os.truncate", "os.mkfifo"),
    *("os.chmod", "os.chown", "os.utime", "os.setxattr", "shutil.rmtree", "shutil.move"),
)
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
DEVICES = ("/dev/null", "/dev/urandom", "/dev/random", "/proc/cpuinfo", "/proc/meminfo", "/proc/self", "/sys/devices")


class NotForAgents(PermissionError):
    """An agent tried something that it may not do."""

    def __init__(self, action: str) -> None:
        super().__init__(f"agents may not {action}")


def install(readable: Sequence[Path], scratch: Path) -> None:
    """Limits this process from now on: it reads Python's files and `readable`, and writes below `scratch` only."""
    hide_simulator()
    package = Path(__file__).resolve().parents[2]
    python = {sys.prefix, sys.base_prefix, sys.exec_prefix, *(entry for entry in sys.path if "-packages" in entry)}
    system = (*DEVICES, "/usr", "/lib", "/lib64", "/etc")
    allowed = [os.path.realpath(path) for path in (*python, *system, package, package.parent / "baselines", *readable)]
    secrets = [f"{package}/data/{start}" for start in sandbox.SECRET]
    sys.meta_path.insert(0, _HiddenModules())
    sys.addaudithook(_Guard(allowed, os.path.realpath(scratch), secrets))


def public_files() -> list[Path]:
    """The package's files that the process of an agent may read."""
    package = Path(__file__).resolve().parents[2]
    worker = (*WORKER, *(f"{WORKER[0]}.{name}" for name in WORKER_FILES), "dextron_bench.world.registration")
    places = [package.parent.joinpath(*name.split(".")) for name in (*PUBLIC, *worker)]
    modules = [place / "__init__.py" if place.is_dir() else place.with_suffix(".py") for place in places]
    return sorted({*modules, package / "world" / "hand.json", *(package / "data").glob("success-*.safetensors")})


def hide_simulator() -> None:
    """Removes the simulator, and public names whose modules are hidden, from this process."""
    from dextron_bench.world import model

    model.load.cache_clear()
    package = vars(sys.modules["dextron_bench"])
    for name in [name for name, value in package.items() if _is_hidden(str(getattr(value, "__module__", "")))]:
        del package[name]  # A public name that was used before: its module is hidden.
    for name in list(sys.modules):
        if _is_hidden(name):
            parent, _, last = name.rpartition(".")
            if parent and hasattr(sys.modules.get(parent), last):
                delattr(sys.modules[parent], last)
            del sys.modules[name]


def _is_hidden(module: str) -> bool:
    top = module.partition(".")[0]
    is_own = top == "dextron_bench" and module not in PUBLIC and not module.startswith(WORKER)
    return is_own or top in sandbox.SIMULATORS


def _check_import(module: str) -> None:
    if _is_hidden(module):
        raise NotForAgents(f"import {module}, which gives access to the simulator or the splits")


class _HiddenModules(MetaPathFinder):
    """Refuses hidden modules to `importlib.import_module`, which raises no audit event; raises NotForAgents."""

    def find_spec(self, fullname: str, *_: object) -> None:
        """Finds no module; raises if the module is hidden."""
        _check_import(fullname)


class _Guard:
    """The audit hook; raises NotForAgents."""

    def __init__(self, allowed: Sequence[str], scratch: str, secrets: Sequence[str]) -> None:
        self._allowed, self._scratch, self._secrets = tuple(allowed), scratch, tuple(secrets)

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "import":
            _check_import(arguments[0])
        elif event == "open":
            self._check_open(*arguments)
        elif event in CHANGING:
            self._check_change(arguments, event)
        elif event in LISTING and _is_path(arguments[0]):
            self._check_read(os.path.realpath(os.fsdecode(arguments[0])))
        elif event.startswith(NETWORK):
            raise NotForAgents(f"use the network ({event})")
        elif event == DATABASE:
            raise NotForAgents("open databases: a database can write any file")
        elif event.startswith(PROCESSES):
            raise NotForAgents(f"start or signal processes ({event})")
        elif event.startswith(INTROSPECTION):
            raise NotForAgents(f"search the process they run in ({event})")

    def _check_open(self, path: Any, mode: str | None, flags: int) -> None:
        if not _is_path(path):
            return  # A file descriptor.
        real = os.path.realpath(os.fsdecode(path))
        if mode is None and os.path.isdir(real) and not _is_within(real, self._scratch):
            raise NotForAgents(f"open the folder {real}: the hook does not see files that are opened through it")
        if flags & WRITING and real != "/dev/null" and not _is_within(real, self._scratch):
            raise NotForAgents(f"write {real}: they may write only in the folder that they start in")
        self._check_read(real)

    def _check_read(self, path: str) -> None:
        if path.startswith(self._secrets):
            raise NotForAgents(f"read {path}: settings and experts are not for agents")
        if not any(_is_within(path, folder) for folder in (*self._allowed, self._scratch)):
            raise NotForAgents(f"read {path}: they may read only Python's files and their own folder")

    def _check_change(self, arguments: tuple[Any, ...], event: str) -> None:
        paths = [os.path.realpath(os.fsdecode(path)) for path in arguments if _is_path(path)]
        descriptors = [last for last in arguments[-1:] if type(last) is int and last >= 0 and event != "os.truncate"]
        if descriptors or not all(_is_within(path, self._scratch) for path in paths):
            raise NotForAgents(f"change files outside the folder they start in ({event} {' '.join(paths)})")


def _is_path(value: Any) -> bool:
    return isinstance(value, str | bytes | os.PathLike)


def _is_within(path: str, folder: str) -> bool:
    return path == folder or path.startswith(folder.rstrip("/") + "/")
