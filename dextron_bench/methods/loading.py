"""Classes of methods, loaded from entry points, modules and files; their code may raise anything when imported."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import os
import sys
from collections.abc import Callable
from importlib.machinery import ModuleSpec, PathFinder
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from dextron_bench.errors import NotFound
from dextron_bench.methods.specs import AgentSpec

GROUP = "dextron_bench.methods"  # Entry points of installed methods.
PREFIX = "dextron_entrant_"  # Begins the names of modules that are loaded from files.


class UnknownMethod(NotFound):
    """A method that does not exist, or a class that is not a method."""

    def __str__(self) -> str:
        return str(self.args[0])


def installed_methods() -> tuple[str, ...]:
    """Names of the installed methods, sorted."""
    return tuple(sorted(entry_points(group=GROUP).names))


def load_class(spec: AgentSpec) -> Any:
    """What a spec of kind method, module or file names.

    Raises UnknownMethod if there is no such method or name, the import fails, or the spec is of another kind.
    """
    if spec.kind == "method":
        return _load_installed(spec.name)
    if spec.kind == "module":
        module = _import(str(spec), lambda: _named_module(spec.location))
    elif spec.kind == "file":
        module = _import(str(spec), lambda: _module_of_file(spec))
    else:
        raise UnknownMethod(f"{str(spec)!r} is a {spec.kind}, not a method; {_choices()}")
    if not hasattr(module, spec.name):
        classes = [name for name, value in vars(module).items() if isinstance(value, type) and hasattr(value, "name")]
        instead = f"; it has {', '.join(classes)}" if classes else ""
        raise UnknownMethod(f"method {str(spec)!r}: {spec.location} has no class {spec.name!r}{instead}")
    return getattr(module, spec.name)


def find_package(name: str) -> ModuleSpec | None:
    """The package or module of a name, installed or else in the working folder; None if neither has it.

    Raises ValueError if the name is no module's.
    """
    return importlib.util.find_spec(name) or PathFinder.find_spec(name, [os.getcwd()])


def class_origin(cls: type) -> dict[str, str | None]:
    """Where a class comes from: `class` is its name, `sha256` the hash of its file, None if it is in a module."""
    module, digest = cls.__module__, None
    if module.startswith(PREFIX) and (file := sys.modules[module].__file__):
        module, digest = Path(file).name, hashlib.sha256(Path(file).read_bytes()).hexdigest()
    return {"class": f"{module}:{cls.__qualname__}", "sha256": digest}


def _load_installed(name: str) -> Any:
    entries = list(entry_points(group=GROUP, name=name))
    if not entries:
        raise UnknownMethod(f"no method {name!r}; {_choices()}")
    return _import(name, entries[0].load)


def _choices() -> str:
    return f"choose from {', '.join(installed_methods())}, or give module:Class or file.py:Class"


def _import(spec: str, load: Callable[[], Any]) -> Any:
    """The result of `load`, which runs an entrant's code: the code may raise anything, or end the process."""
    try:
        return load()
    except UnknownMethod:
        raise
    except ModuleNotFoundError as error:
        raise UnknownMethod(f"method {spec!r} needs the Python module {error.name}, which is not installed") from error
    except (Exception, SystemExit) as error:
        raise UnknownMethod(f"method {spec!r} cannot be imported: {type(error).__name__}: {error}") from error


def _named_module(name: str) -> ModuleType:
    """The module of a dotted name. If its package lies in the working folder, that folder is searched from now on.

    It is searched last: no file there replaces a module of a library.
    """
    package = name.partition(".")[0]
    if package not in sys.modules and importlib.util.find_spec(package) is None and find_package(package):
        sys.path.append(os.getcwd())
    return importlib.import_module(name)


def _module_of_file(spec: AgentSpec) -> ModuleType:
    """The module of a file; a process executes each file once."""
    file = Path(spec.location).resolve()
    if not file.is_file():
        raise UnknownMethod(f"method {str(spec)!r}: there is no file {spec.location}")
    name = f"{PREFIX}{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    module_spec = importlib.util.spec_from_file_location(name, file)
    assert module_spec is not None
    assert module_spec.loader is not None
    module = importlib.util.module_from_spec(module_spec)
    sys.modules[name] = module
    try:
        module_spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
