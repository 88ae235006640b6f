"""The agent of the tutorial after its improvement: it begins to close earlier if the hand comes fast."""

from __future__ import annotations

import numpy as np

from dextron_bench.world import task

VELOCITY = slice(31, 33)  # Indices of the palm's velocity along x and y [m/s] in a state.


class MyAgent:
    """Starts to close within a distance of the bottle that grows with the hand's speed, and then keeps closing."""

    name = "my-agent"

    def __init__(self, near: float = 0.05, lead: float = 0.06) -> None:
        """Takes a distance `near` [m] for a slow hand, and how much it grows with the highest speed, `lead` [s]."""
        self.near, self.lead = near, lead
        self._closing, self._fastest = np.zeros(0, bool), np.zeros(0)  # A flag and a speed for each episode.

    def agent(self, seed: int) -> MyAgent:
        """The agent for a seed; this one is the same for every seed."""
        return self

    def reset(self, episodes: np.ndarray) -> None:
        """Receives the rows of the next states that begin a new episode; their memory must be cleared."""
        missing = max(0, int(episodes.max(initial=-1)) + 1 - len(self._closing))
        self._closing, self._fastest = np.pad(self._closing, (0, missing)), np.pad(self._fastest, (0, missing))
        self._closing[episodes], self._fastest[episodes] = False, 0.0

    def act(self, states: np.ndarray) -> np.ndarray:
        """Maps states (N, 48) to closing speeds (N, 1) in [-1, 1], a row for each of N episodes."""
        self._fastest = np.maximum(self._fastest, np.linalg.norm(states[:, VELOCITY], axis=1))
        self._closing |= task.distance(states) < self.near + self.lead * self._fastest
        return np.where(self._closing, 1.0, -1.0)[:, None]
