"""Tests of the agent with states made by hand; run them with `pytest`."""

from __future__ import annotations

import numpy as np
from agent import MyAgent  # pyright: ignore[reportMissingImports]


def states(*distances: float) -> np.ndarray:
    """States (N, 48) with the palm at these distances [m] from a bottle at the origin; all other numbers are 0."""
    rows = np.zeros((len(distances), 48))
    rows[:, 8] = distances
    return rows


def test_it_opens_far_away_closes_near_and_keeps_closing():
    agent = MyAgent(near=0.1).agent(seed=0)
    agent.reset(np.array([0, 1]))
    np.testing.assert_array_equal(agent.act(states(0.3, 0.05)), [[-1.0], [1.0]])
    np.testing.assert_array_equal(agent.act(states(0.3, 0.30)), [[-1.0], [1.0]])


def test_a_new_episode_clears_the_memory():
    agent = MyAgent(near=0.1).agent(seed=0)
    agent.reset(np.array([0]))
    agent.act(states(0.05))
    agent.reset(np.array([0]))
    np.testing.assert_array_equal(agent.act(states(0.3)), [[-1.0]])
