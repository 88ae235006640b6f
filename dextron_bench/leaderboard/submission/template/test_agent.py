"""Run with `pytest`: what the agent is meant to do, by hand."""

from __future__ import annotations

import numpy as np
from agent import MyAgent  # pyright: ignore[reportMissingImports]


def states(*distances: float) -> np.ndarray:
    """States (N, 48) with the palm so far from a bottle at the origin [m], all else 0."""
    found = np.zeros((len(distances), 48))
    found[:, 8] = distances
    return found


def test_it_opens_far_away_closes_near_and_does_not_change_its_mind():
    agent = MyAgent(near=0.1).agent(seed=0)
    agent.reset(np.array([0, 1]))
    np.testing.assert_array_equal(agent.act(states(0.3, 0.05)), [[-1.0], [1.0]])
    np.testing.assert_array_equal(agent.act(states(0.3, 0.30)), [[-1.0], [1.0]])


def test_a_new_episode_begins_afresh():
    agent = MyAgent(near=0.1).agent(seed=0)
    agent.reset(np.array([0]))
    agent.act(states(0.05))
    agent.reset(np.array([0]))
    np.testing.assert_array_equal(agent.act(states(0.3)), [[-1.0]])
