"""An agent in a process of its own, with limits on time and memory; the process is started again if it fails."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass

import numpy as np

from dextron_bench.methods.agents import AgentCrashed, AgentError
from dextron_bench.methods.isolation import protocol
from dextron_bench.methods.isolation.launch import Launch
from dextron_bench.methods.isolation.process import NoAnswer, Process


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of an agent's process: time [s] to start, for one answer, and for a whole split; memory, disk [bytes]."""

    start: float = 300.0  # PyTorch on a slow disk takes a minute.
    answer: float = 10.0
    total: float = 3600.0
    memory: int = 4 * 2**30
    disk: int = 512 * 2**20

    def __post_init__(self) -> None:
        if not min(self.start, self.answer, self.total, self.memory, self.disk) > 0:
            raise AgentError("an agent needs time and memory: --timeout and --memory are more than 0")


class IsolatedAgent:
    """The agent of another process; use it in a `with` block, or call `close`.

    `act` raises AgentError if the process does not start the first time. Every later failure raises AgentCrashed: the
    current episodes fail, and the next call of `act` starts the process again.
    """

    def __init__(self, launch: Launch, seed: int = 0, limits: Limits | None = None) -> None:
        self._launch, self._seed, self._limits = launch, seed, limits or Limits()
        self._process: Process | None = None
        self._begun: list[int] = []
        self._scratch = tempfile.TemporaryDirectory(prefix="dextron-agent-", ignore_cleanup_errors=True)
        self._spent = 0.0  # [s] for starts and answers so far.
        self.starts = 0
        self.peak = 0  # [bytes] highest use of memory; 0 if the system does not report it.

    def __enter__(self) -> IsolatedAgent:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the process and removes its folder."""
        self._stop()
        self._scratch.cleanup()

    def reset(self, episodes: np.ndarray) -> None:
        """Notes that rows `episodes` begin a new episode; the next request passes this to the agent."""
        self._begun += episodes.tolist()

    def act(self, states: np.ndarray) -> np.ndarray:
        """Actions (N, 1) for states (N, 48); raises AgentCrashed, AgentError."""
        begun, self._begun = sorted(set(self._begun)), []
        if self._spent > self._limits.total:
            self._stop()
            raise AgentCrashed(f"it has had the {self._limits.total:g} s that all its answers may take")
        start = time.monotonic()
        try:
            return self._ask(protocol.write_question(begun, states), len(states))
        finally:
            self._spent += time.monotonic() - start

    def _ask(self, question: bytes, count: int) -> np.ndarray:
        process = self._process or self._start(count)
        try:
            return protocol.read_actions(process.ask(question, self._limits.answer), count)
        except (protocol.BadAnswer, NoAnswer) as error:
            reason = process.describe_failure(error)
            self._stop()
            raise AgentCrashed(reason) from error

    def _start(self, episodes: int) -> Process:
        self.starts += 1
        try:
            size, limits = protocol.max_answer_size(episodes), self._limits
            command = self._launch.command_line(self._scratch.name, limits.memory, limits.disk)
            process = self._process = Process(command, self._scratch.name, size, limits.memory, limits.disk)
        except (OSError, IndexError) as error:
            raise AgentError(f"the agent's process cannot be started: {error}") from error
        try:
            protocol.read_greeting(process.ask(protocol.write_greeting(self._seed, episodes), self._limits.start))
        except (protocol.BadAnswer, NoAnswer) as error:
            reason = process.describe_failure(error)
            self._stop()
            raise (AgentCrashed if self.starts > 1 else AgentError)(f"the agent did not start: {reason}") from error
        return process

    def _stop(self) -> None:
        if self._process:
            self.peak = max(self.peak, self._process.peak_memory())
            self._process.kill()
            self._process = None
