"""What an agent offers, and the errors that an agent's code can cause."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from dextron_bench.errors import BadInput, Failed

if TYPE_CHECKING:
    from dextron_bench.experts.policies import Expert


class Agent(Protocol):
    """Acts in N episodes at once; it may keep memory for each episode.

    An agent whose attribute `rows_are_independent` is True promises that its actions in an episode follow from the
    states of that episode alone, so that the rows of a split can be played in pieces, with the same bits.
    """

    def reset(self, episodes: np.ndarray) -> None:
        """Announces that rows `episodes` (n,) of the next states begin a new episode; called before that `act`."""
        ...

    def act(self, states: np.ndarray) -> np.ndarray:
        """Maps states (N, 48) to closing speeds (N, 1), floats in [-1, 1]; N is the same in every call.

        A speed up to 1e-6 outside is clipped. NaN, or a speed further outside, fails the episode of its row. Another
        shape or type ends the evaluation.
        """
        ...


@runtime_checkable
class Privileged(Protocol):
    """An agent that receives each setting's expert. On the leaderboard only EXP does."""

    def assign(self, episodes: np.ndarray, experts: Sequence[Expert]) -> None:
        """Receives the experts of the settings that rows `episodes` (n,) play next; called before `reset`."""
        ...


class AgentError(BadInput):
    """The agent's code raised an exception, or its actions have a wrong shape or type."""


class AgentCrashed(Failed):
    """Raised in `act` by an agent that can start again: the current episodes fail, and the others are still played."""


@contextmanager
def as_agent_error(call: str) -> Iterator[None]:
    """Turns any exception of an agent's code into an AgentError; `call` names the code, such as "act()"."""
    try:
        yield
    except (AgentCrashed, AgentError):
        raise
    except Exception as error:
        raise AgentError(f"{call} raised {type(error).__name__}: {error}; --debug shows where") from error
