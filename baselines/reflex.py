"""REFLEX: opens the hand until it comes near the bottle, then closes it for good; it learns nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dextron_bench.errors import BadInput
from dextron_bench.world import task


@dataclass(frozen=True)
class Reflex:
    """Opens at full speed until the hand comes within a distance, the same for every reach, then closes to the end."""

    name: ClassVar[str] = "reflex"

    near: float = 0.065
    """Distance from the palm's centre to the bottle [m]; the default is the best of 0.05, 0.055, ... on `val`."""

    def __post_init__(self) -> None:
        if not self.near >= 0.0:
            raise BadInput(f"--near is {self.near:g}; a distance is 0 or more")

    def agent(self, seed: int) -> ReflexAgent:
        """An agent; it is the same for every seed."""
        return ReflexAgent(self.near)


class ReflexAgent:
    """Opens until the palm's centre comes within `near` [m] of the bottle's axis, then closes, and never reopens."""

    rows_are_independent = True

    def __init__(self, near: float) -> None:
        self._near, self._closes = near, np.zeros(0, bool)

    def reset(self, episodes: np.ndarray) -> None:
        """Rows `episodes` (n,) begin a new episode, with an opening hand."""
        self._grow(int(episodes.max(initial=-1)) + 1)
        self._closes[episodes] = False

    def act(self, states: np.ndarray) -> np.ndarray:
        """Actions (N, 1), -1 or 1, for states (N, 48)."""
        self._grow(len(states))
        self._closes |= task.distance(states) <= self._near
        return np.where(self._closes, 1.0, -1.0)[:, None]

    def _grow(self, n: int) -> None:
        self._closes = np.pad(self._closes, (0, max(n - len(self._closes), 0)))
