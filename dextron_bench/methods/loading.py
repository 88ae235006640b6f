"""Code of entrants: classes by the name of a module or a file, which may raise anything when they are imported."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

PREFIX = "dextron_entrant_"  # What the names of modules made of files begin with.


class UnknownMethod(KeyError):
    """A method that is not there, or is none."""

    def __str__(self) -> str:
        return str(self.args[0])


def find(spec: str) -> Any:
    """What `module:Class` or `file.py:Class` names, or None; raises UnknownMethod where it cannot be imported."""
    place, _, name = spec.rpartition(":")
    module = loaded(spec, lambda: _from_file(spec, place) if place.endswith(".py") else importlib.import_module(place))
    return getattr(module, name, None)


def origin(found: type) -> dict[str, str | None]:
    """Where a class is from: its name, and for one of a file the SHA-256 of its content."""
    called, digest = found.__module__, None
    if called.startswith(PREFIX) and (file := sys.modules[called].__file__):
        called, digest = Path(file).name, hashlib.sha256(Path(file).read_bytes()).hexdigest()
    return {"class": f"{called}:{found.__qualname__}", "sha256": digest}


def loaded(spec: str, load: Callable[[], Any]) -> Any:
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
    name = f"{PREFIX}{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
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
