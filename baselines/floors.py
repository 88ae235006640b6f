"""Floors: the scores of no action and of random actions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np


class _ZeroAgent:
    """Always sends 0."""

    rows_are_independent = True

    def reset(self, episodes: np.ndarray) -> None:
        """Does nothing: the agent has no memory."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Zeros (N, 1) for states (N, 48)."""
        return np.zeros((len(states), 1))


class _NoiseAgent:
    """Sends uniform noise from one generator."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def reset(self, episodes: np.ndarray) -> None:
        """Does nothing: the agent has no memory."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Uniform actions (N, 1) in [-1, 1] for states (N, 48)."""
        return self._rng.uniform(-1.0, 1.0, (len(states), 1))


@dataclass(frozen=True)
class Nothing:
    """Leaves the fingers half closed, as they start."""

    name: ClassVar[str] = "nothing"

    def agent(self, seed: int) -> _ZeroAgent:
        """The agent, the same for every seed."""
        return _ZeroAgent()


@dataclass(frozen=True)
class Random:
    """Moves the fingers at random."""

    name: ClassVar[str] = "random"

    def agent(self, seed: int) -> _NoiseAgent:
        """An agent with its own random stream for every seed."""
        return _NoiseAgent(seed)
