"""An agent in a process of its own, with limits on time and memory, started again where it fails."""

from __future__ import annotations

import importlib.util
import json
import shlex
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.evaluation.rollout import AgentDown, AgentError
from dextron_bench.methods.isolation import protocol as wire
from dextron_bench.methods.isolation import sandbox
from dextron_bench.methods.isolation.process import Process, Silent


@dataclass(frozen=True, slots=True)
class Limits:
    """Seconds to start, for one answer, and for starts and answers of a split altogether; and bytes of memory."""

    start: float = 60.0
    answer: float = 10.0
    total: float = 3600.0
    memory: int = 4 * 2**30

    def __post_init__(self) -> None:
        if not min(self.start, self.answer, self.total, self.memory) > 0:
            raise AgentError("an agent needs time and memory: --timeout and --memory are more than 0")


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


class Isolated:
    """Plays the agent of a process; use it as a context, or `close` it.

    Raises AgentError where the process does not start the first time; what goes wrong later raises AgentDown, which
    fails the episodes that were being played, and the next question starts the process again.
    """

    def __init__(self, how: Launch, seed: int = 0, limits: Limits | None = None) -> None:
        self._how, self._seed, self._limits = how, seed, limits or Limits()
        self._process: Process | None = None
        self._begun: list[int] = []
        self._scratch = tempfile.TemporaryDirectory(prefix="dextron-agent-", ignore_cleanup_errors=True)
        self._spent = 0.0  # [s] for starts and answers so far.
        self.starts = 0
        self.peak = 0  # [bytes] of memory at most, as last seen; 0 where the system does not tell.

    def __enter__(self) -> Isolated:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the process."""
        self._stop()
        self._scratch.cleanup()

    def reset(self, episodes: np.ndarray) -> None:
        """Tells, with the next question, that rows `episodes` begin a new episode."""
        self._begun += episodes.tolist()

    def act(self, states: np.ndarray) -> np.ndarray:
        """Actions (N, 1) for states (N, 48); raises AgentDown, AgentError."""
        begun, self._begun = sorted(set(self._begun)), []
        if self._spent > self._limits.total:
            self._stop()
            raise AgentDown(f"it has had the {self._limits.total:g} s that all its answers may take")
        asked = time.monotonic()
        try:
            return self._answer(wire.question(begun, states), len(states))
        finally:
            self._spent += time.monotonic() - asked

    def _answer(self, question: bytes, count: int) -> np.ndarray:
        process = self._process or self._start(count)
        try:
            return wire.actions(process.ask(question, self._limits.answer), count)
        except (wire.BadAnswer, Silent) as error:
            why = process.epitaph(error)
            self._stop()
            raise AgentDown(why) from error

    def _start(self, episodes: int) -> Process:
        self.starts += 1
        try:
            words = self._how.words(self._scratch.name, self._limits.memory)
            process = self._process = Process(words, self._scratch.name, wire.longest(episodes))
        except (OSError, IndexError) as error:
            raise AgentError(f"the agent's process cannot be started: {error}") from error
        try:
            wire.greeted(process.ask(wire.greeting(self._seed, episodes), self._limits.start))
        except (wire.BadAnswer, Silent) as error:
            why = process.epitaph(error)
            self._stop()
            raise (AgentDown if self.starts > 1 else AgentError)(f"the agent did not start: {why}") from error
        return process

    def _stop(self) -> None:
        if self._process:
            self.peak = max(self.peak, self._process.peak())
            self._process.kill()
            self._process = None
