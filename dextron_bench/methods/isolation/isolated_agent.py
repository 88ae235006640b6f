"""An agent in a process of its own, with limits on time and memory, started again where it fails."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass

import numpy as np

from dextron_bench.methods.agents import AgentCrashed, AgentError
from dextron_bench.methods.isolation import protocol
from dextron_bench.methods.isolation.launch import Launch
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


class Isolated:
    """Plays the agent of a process; use it as a context, or `close` it.

    Raises AgentError where the process does not start the first time; what goes wrong later raises AgentCrashed, which
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
        """Actions (N, 1) for states (N, 48); raises AgentCrashed, AgentError."""
        begun, self._begun = sorted(set(self._begun)), []
        if self._spent > self._limits.total:
            self._stop()
            raise AgentCrashed(f"it has had the {self._limits.total:g} s that all its answers may take")
        asked = time.monotonic()
        try:
            return self._answer(protocol.question(begun, states), len(states))
        finally:
            self._spent += time.monotonic() - asked

    def _answer(self, question: bytes, count: int) -> np.ndarray:
        process = self._process or self._start(count)
        try:
            return protocol.actions(process.ask(question, self._limits.answer), count)
        except (protocol.BadAnswer, Silent) as error:
            why = process.epitaph(error)
            self._stop()
            raise AgentCrashed(why) from error

    def _start(self, episodes: int) -> Process:
        self.starts += 1
        try:
            words = self._how.words(self._scratch.name, self._limits.memory)
            process = self._process = Process(words, self._scratch.name, protocol.longest(episodes))
        except (OSError, IndexError) as error:
            raise AgentError(f"the agent's process cannot be started: {error}") from error
        try:
            protocol.greeted(process.ask(protocol.greeting(self._seed, episodes), self._limits.start))
        except (protocol.BadAnswer, Silent) as error:
            why = process.epitaph(error)
            self._stop()
            raise (AgentCrashed if self.starts > 1 else AgentError)(f"the agent did not start: {why}") from error
        return process

    def _stop(self) -> None:
        if self._process:
            self.peak = max(self.peak, self._process.peak())
            self._process.kill()
            self._process = None
