"""An agent for dextron-bench: opens the hand far from the bottle and closes it near the bottle. Improve it."""

from __future__ import annotations

import numpy as np

BOTTLE, PALM = slice(0, 2), slice(7, 9)  # Indices of x and y [m] of bottle and palm in a state.


class MyAgent:
    """Starts to close when the palm comes within a distance of the bottle, and then keeps closing."""

    name = "my-agent"

    def __init__(self, near: float = 0.12) -> None:
        """Takes the settings, each with a default; `near` is a distance [m]."""
        self.near = near
        self._closing = np.zeros(0, bool)  # One flag for each episode.

    def agent(self, seed: int) -> MyAgent:
        """The agent for a seed; an agent that uses random numbers seeds its generator with it."""
        return self

    def reset(self, episodes: np.ndarray) -> None:
        """Receives the rows of the next states that begin a new episode; their memory must be cleared."""
        missing = max(0, int(episodes.max(initial=-1)) + 1 - len(self._closing))
        self._closing = np.pad(self._closing, (0, missing))
        self._closing[episodes] = False

    def act(self, states: np.ndarray) -> np.ndarray:
        """Maps states (N, 48) to closing speeds (N, 1) in [-1, 1], a row for each of N episodes."""
        distance = np.linalg.norm(states[:, PALM] - states[:, BOTTLE], axis=1)
        self._closing = np.pad(self._closing, (0, max(0, len(states) - len(self._closing))))
        self._closing[: len(states)] |= distance < self.near
        return np.where(self._closing[: len(states)], 1.0, -1.0)[:, None]
