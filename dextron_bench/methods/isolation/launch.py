"""How to start the process of an agent that a user names."""

from __future__ import annotations

import importlib.util
import json
import shlex
import sys
from dataclasses import asdict, dataclass, field
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.isolation import sandbox


@dataclass(frozen=True, slots=True)
class Launch:
    """What starts an agent's process: words of a command, or, for Python's, what `worker` is told."""

    command: tuple[str, ...] = ()
    kind: str = ""
    spec: str = ""
    settings: dict[str, Any] = field(default_factory=dict)
    weights: str = ""
    own: tuple[str, ...] = ()

    def words(self, scratch: str, memory: int) -> list[str]:
        """The command, for a folder that the process may write to."""
        told = {**asdict(self), "scratch": scratch}
        worker = [sys.executable, "-P", "-m", "dextron_bench.methods.isolation.worker", json.dumps(told)]
        return sandbox.wrap(self.command or worker, scratch, self.own, memory)


def launch(spec: str, settings: dict[str, Any] | None = None, weights: Path | None = None) -> Launch:
    """How to start the agent that a user names.

    `exec:COMMAND` is a program that speaks the protocol, `FILE.pt` and `FILE.onnx` are policies, `file.py:Class` and
    `module:Class` are code, all else is an installed method. `weights` are of a method that learns. Raises AgentError.
    """
    file = str(weights.resolve()) if weights else ""
    more = {"settings": settings or {}, "weights": file, "own": (file,) if file else ()}
    place, _, name = spec.rpartition(":")
    if spec.startswith("exec:"):
        words = _words(spec.removeprefix("exec:"))
        files = [str(Path(word).resolve()) for word in words if Path(word).is_file()]
        command = tuple(str(Path(word).resolve()) if Path(word).is_file() else word for word in words)
        return Launch(command=command, own=tuple(str(Path(file).parent) for file in files))
    if Path(spec).suffix in (".pt", ".onnx"):
        whole = str(Path(spec).resolve())
        if not Path(whole).is_file():
            raise AgentError(f"there is no file {spec}")
        return Launch(kind="policy", spec=whole, own=(whole,))
    if spec.endswith(".py"):
        raise AgentError(f"{spec} is a file: name its class too, as in {spec}:MyAgent")
    if place.endswith(".py"):
        if not Path(place).is_file():
            raise AgentError(f"there is no file {place}")
        more["own"] += (str(Path(place).resolve()),)
        return Launch(kind="code", spec=f"{Path(place).resolve()}:{name}", **more)
    if place and (found := _module(place.partition(".")[0])):
        more["own"] += tuple(found.submodule_search_locations or [found.origin or ""])
    return Launch(kind="code" if place else "method", spec=spec, **more)


def _words(command: str) -> list[str]:
    try:
        return shlex.split(command)
    except ValueError as error:
        raise AgentError(f"exec:{command} is no command ({error})") from error


def _module(name: str) -> ModuleSpec | None:
    try:
        return importlib.util.find_spec(name)
    except ValueError as error:
        raise AgentError(f"{name} is no module that agents can come from ({error})") from error
