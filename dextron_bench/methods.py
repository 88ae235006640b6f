"""Methods by name: entry points of the group `dextron_bench.methods`, `module:Class` or `file.py:Class`."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import re
import sys
from collections.abc import Callable
from dataclasses import asdict, is_dataclass
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, Protocol

from dextron_bench.rollout import Agent, blaming

GROUP = "dextron_bench.methods"
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*")  # A run's folder is called like its method.


class Method(Protocol):
    """A way to get an agent. A frozen dataclass whose fields are its settings, each with a default."""

    name: ClassVar[str]

    def agent(self, seed: int) -> Agent:
        """An agent ready to act; equal seeds give agents that act equally."""
        ...


class UnknownMethod(KeyError):
    """A method that is not there, or is none."""

    def __str__(self) -> str:
        return str(self.args[0])


def known() -> tuple[str, ...]:
    """Names of the installed methods."""
    return tuple(sorted(entry_points(group=GROUP).names))


def find(spec: str) -> type[Method]:
    """The method's class; raises UnknownMethod with what would be right."""
    if ":" not in spec:
        found = list(entry_points(group=GROUP, name=spec))
        if not found:
            raise UnknownMethod(
                f"no method {spec!r}; choose from {', '.join(known())}, or give module:Class or file.py:Class"
            )
        return _checked(spec, _loaded(spec, found[0].load))
    place, _, name = spec.rpartition(":")
    module = _loaded(spec, lambda: _from_file(spec, place) if place.endswith(".py") else importlib.import_module(place))
    return _checked(spec, getattr(module, name, None))


def create(spec: str) -> Method:
    """The method with its default settings; raises UnknownMethod, AgentError."""
    found = find(spec)
    with blaming(f"making method {spec!r}"):
        return found()


def origin(spec: str) -> dict[str, str | None]:
    """Where a method's code is from: its class, and for a file the SHA-256 of its content."""
    place, _, name = spec.rpartition(":")
    if place.endswith(".py"):
        return {"class": f"{Path(place).name}:{name}", "sha256": hashlib.sha256(Path(place).read_bytes()).hexdigest()}
    found = find(spec)
    return {"class": f"{found.__module__}:{found.__qualname__}", "sha256": None}


def describe(name: str) -> str:
    """What an installed method is, in a line, or why it cannot be used."""
    try:
        return (find(name).__doc__ or "").strip().partition("\n")[0]
    except UnknownMethod as error:
        return str(error)


def settings(method: Method) -> dict[str, Any]:
    """A method's settings as plain values."""
    return asdict(method) if is_dataclass(method) and not isinstance(method, type) else {}


def _checked(spec: str, found: Any) -> type[Method]:
    if not isinstance(found, type) or not hasattr(found, "agent") or not hasattr(found, "name"):
        raise UnknownMethod(f"{spec!r} is not a method: it needs to be a class with `name` and `agent(seed)`")
    if not isinstance(found.name, str) or not NAME.fullmatch(found.name):
        raise UnknownMethod(f"{spec!r} has the name {found.name!r}: use letters, digits and . _ + -, as in 'my-method'")
    return found


def _loaded(spec: str, load: Callable[[], Any]) -> Any:
    """What `load` gives; an entrant's code may raise anything, or end the process."""
    try:
        return load()
    except UnknownMethod:
        raise
    except (Exception, SystemExit) as error:
        raise UnknownMethod(f"method {spec!r} cannot be imported: {type(error).__name__}: {error}") from error


def _from_file(spec: str, place: str) -> ModuleType:
    """The module of a file, executed once in a process."""
    file = Path(place).resolve()
    if not file.is_file():
        raise UnknownMethod(f"method {spec!r}: there is no file {place}")
    name = f"dextron_entrant_{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    loaded = importlib.util.spec_from_file_location(name, file)
    assert loaded is not None
    assert loaded.loader is not None
    module = importlib.util.module_from_spec(loaded)
    sys.modules[name] = module
    try:
        loaded.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
