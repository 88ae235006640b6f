"""What an agent offers, and the errors that its code leads to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol, runtime_checkable

import numpy as np

from dextron_bench.experts.policies import Expert


class Agent(Protocol):
    """Acts in N episodes at once; may keep memory per episode."""

    def reset(self, episodes: np.ndarray) -> None:
        """Tells that rows `episodes` (n,) of the states to come begin a new episode."""
        ...

    def act(self, states: np.ndarray) -> np.ndarray:
        """Maps states (N, 48) to closing speeds (N, 1) in [-1, 1]. N stays the same from call to call."""
        ...


@runtime_checkable
class Privileged(Protocol):
    """An agent that is told each setting's own expert: EXP, and no other on the leaderboard."""

    def assign(self, episodes: np.ndarray, experts: Sequence[Expert]) -> None:
        """Comes before `reset`: rows `episodes` (n,) are about to play these experts' settings."""
        ...


class AgentError(ValueError):
    """An agent that raises, or whose actions are not of the agreed shape."""


class AgentCrashed(RuntimeError):
    """Raised in `act` by an agent that can start again: it fails the episodes that are being played, and no others."""


@contextmanager
def as_agent_error(what: str) -> Iterator[None]:
    """Makes what an entrant's own code raises an AgentError that says where: `what`, a phrase like "act()"."""
    try:
        yield
    except (AgentCrashed, AgentError):
        raise
    except Exception as error:
        raise AgentError(f"{what} raised {type(error).__name__}: {error}; --debug shows where") from error
