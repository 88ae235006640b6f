"""An agent in a process of its own, with limits on time and memory, started again where it fails."""

from __future__ import annotations

import importlib.util
import json
import os
import queue
import shlex
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np

from dextron_bench.isolation import sandbox, wire
from dextron_bench.rollout import AgentDown, AgentError

KEPT = ("PATH", "PYTHONPATH", "LANG", "LC_ALL", "SYSTEMROOT", "VIRTUAL_ENV")  # Of the environment.
TAIL = 2000  # [bytes] of what an agent writes to its stderr that are looked at.


@dataclass(frozen=True, slots=True)
class Limits:
    """Seconds to start, seconds for one answer, and bytes of memory."""

    start: float = 60.0
    answer: float = 10.0
    memory: int = 4 * 2**30


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
        worker = [sys.executable, "-P", "-m", "dextron_bench.isolation.worker", json.dumps(told)]
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
        words = shlex.split(spec.removeprefix("exec:"))
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
    if place and (found := importlib.util.find_spec(place.partition(".")[0])):
        more["own"] += tuple(found.submodule_search_locations or [found.origin or ""])
    return Launch(kind="code" if place else "method", spec=spec, **more)


class Isolated:
    """Plays the agent of a process; use it as a context, or `close` it.

    Raises AgentError where the process does not start the first time; what goes wrong later raises AgentDown, which
    fails the episodes that were being played, and the next question starts the process again.
    """

    def __init__(self, how: Launch, seed: int = 0, limits: Limits | None = None) -> None:
        self._how, self._seed, self._limits = how, seed, limits or Limits()
        self._process: _Process | None = None
        self._begun: list[int] = []
        self._scratch = tempfile.TemporaryDirectory(prefix="dextron-agent-", ignore_cleanup_errors=True)
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
        process = self._process or self._start(len(states))
        try:
            line = process.ask(wire.question(begun, states), self._limits.answer)
            return wire.actions(line, len(states))
        except (wire.BadAnswer, _Silent) as error:
            why = process.epitaph(error)
            self._stop()
            raise AgentDown(why) from error

    def _start(self, episodes: int) -> _Process:
        self.starts += 1
        try:
            words = self._how.words(self._scratch.name, self._limits.memory)
            process = self._process = _Process(words, self._scratch.name, wire.longest(episodes))
        except (OSError, IndexError) as error:
            raise AgentError(f"the agent's process cannot be started: {error}") from error
        try:
            wire.greeted(process.ask(wire.greeting(self._seed, episodes), self._limits.start))
        except (wire.BadAnswer, _Silent) as error:
            why = process.epitaph(error)
            self._stop()
            raise (AgentDown if self.starts > 1 else AgentError)(f"the agent did not start: {why}") from error
        return process

    def _stop(self) -> None:
        if self._process:
            self.peak = max(self.peak, self._process.peak())
            self._process.kill()
            self._process = None


class _Silent(RuntimeError):
    """A process from which no answer came."""


class _Process:
    """A process that is asked by lines; threads read and write, so that neither side can hang us."""

    def __init__(self, words: Sequence[str], folder: str, room: int) -> None:
        """Starts it in a folder; its answers may have `room` bytes."""
        environment = {name: os.environ[name] for name in KEPT if name in os.environ}
        environment |= {"HOME": folder, "TMPDIR": folder, "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 (closed by `kill`)
        self._popen = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            cwd=folder,
            env=environment,
            start_new_session=True,
        )
        self._questions: queue.Queue[bytes | None] = queue.Queue()
        self._answers: queue.Queue[bytes] = queue.Queue(2)  # One that is due, and one that tells of too many.
        self._room = room
        assert self._popen.stdin
        assert self._popen.stdout
        threading.Thread(target=self._write, args=(self._popen.stdin,), daemon=True).start()
        threading.Thread(target=self._read, args=(self._popen.stdout,), daemon=True).start()

    def ask(self, question: bytes, seconds: float) -> bytes:
        """The line that answers; raises _Silent."""
        if not self._answers.empty() and (extra := self._answers.get()):
            raise _Silent(f"it wrote {len(extra)} bytes that nobody asked for")
        self._questions.put(question)
        try:
            line = self._answers.get(timeout=seconds)
        except queue.Empty:
            raise _Silent(f"it gave no answer within {seconds:g} s") from None
        if not line.endswith(b"\n"):
            raise _Silent(f"its answer is longer than {self._room} bytes" if len(line) > self._room else "it ended")
        return line

    def epitaph(self, error: Exception) -> str:
        """What went wrong, with how the process ended and the last line that it wrote to stderr."""
        if str(error) == "it ended":
            try:
                code = self._popen.wait(1.0)
            except subprocess.TimeoutExpired:
                code = None
            error = _Silent(f"it ended with {_told(code)}")
        self._said.seek(max(0, self._said.seek(0, os.SEEK_END) - TAIL))
        lines = self._said.read().decode(errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f"{error}: {last}" if last else str(error)

    def peak(self) -> int:
        """The most memory [bytes] that the process has held, 0 where the system does not tell."""
        try:
            return max(map(_peak, _family(self._popen.pid)))
        except (OSError, ValueError):
            return 0

    def kill(self) -> None:
        """Ends the process and what it started."""
        self._questions.put(None)
        try:
            os.killpg(self._popen.pid, signal.SIGKILL)
        except (OSError, AttributeError):
            self._popen.kill()
        self._popen.wait()
        self._said.close()

    def _write(self, pipe: IO[bytes]) -> None:
        try:
            while (question := self._questions.get()) is not None:
                pipe.write(question)
                pipe.flush()
            pipe.close()
        except OSError:
            pass  # It ended; the reader tells.

    def _read(self, pipe: IO[bytes]) -> None:
        with pipe:
            while line := pipe.readline(self._room + 1):
                self._answers.put(line)
                if not line.endswith(b"\n"):
                    return
        self._answers.put(b"")


def _told(code: int | None) -> str:
    """How a process ended, from its exit code; a shell's for a signal is 128 and more."""
    number = -code if code is not None and code < 0 else code - 128 if code is not None and code > 128 else 0
    known = {each.value: each.name for each in signal.Signals}
    return f"signal {known[number]}" if number in known else f"code {code}"


def _family(process: int) -> list[int]:
    """A process and all that came of it."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return [process, *(each for child in children for each in _family(int(child)))]


def _peak(process: int) -> int:
    """The most memory [bytes] that a process has held."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")), 0)
