"""REFLEX: opens while the hand is far from the bottle and closes when it is near; it learns nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dextron_bench.world import task


class BadDistance(ValueError):
    """A distance below 0."""


@dataclass(frozen=True)
class Reflex:
    """Closes at full speed within a distance, the same for every reach, and opens at full speed beyond it."""

    name: ClassVar[str] = "reflex"
    rows_are_independent: ClassVar[bool] = True

    near: float = 0.06
    """Distance from the palm's centre to the bottle [m]; 0.06 is the best of 0.05, 0.06 and 0.08 on `val` of `real`."""

    def __post_init__(self) -> None:
        if not self.near >= 0.0:
            raise BadDistance(f"--near is {self.near:g}; a distance is 0 or more")

    def agent(self, seed: int) -> Reflex:
        """This object: it has no memory, and it is the same for every seed."""
        return self

    def reset(self, episodes: np.ndarray) -> None:
        """Does nothing: the agent has no memory."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Actions (N, 1), -1 or 1, for states (N, 48)."""
        return np.where(task.distance(states) <= self.near, 1.0, -1.0)[:, None]
