"""Agents that promise independent rows: any rows together give the actions that all rows together give."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.floors import Random
from dextron_bench.methods import weights
from dextron_bench.methods.agents import Agent
from tests.helpers.short_reaches import SETTINGS, played

STEPS = 60
AGENTS = ("nothing", "reflex", "omega", "rlil-0.1-quick", "stopping")


def actions(agent: Agent, states: np.ndarray) -> np.ndarray:
    """Actions (T, N) for states (T, N, 48) of episodes that begin together."""
    agent.reset(np.arange(states.shape[1]))
    return np.stack([agent.act(batch)[:, 0] for batch in states])


@pytest.mark.parametrize("name", AGENTS)
def test_rows_are_independent(name: str):
    try:
        _, agent = weights.agent_by_name(name, "synthetic")
    except weights.MissingWeights:
        pytest.skip("no weights ship")
    assert getattr(agent, "rows_are_independent", False)
    states = np.stack([played(k).states[:STEPS] for k in range(len(SETTINGS))], axis=1)
    together = actions(agent, states)
    for rows in ([0], [3, 1], [4, 2]):
        np.testing.assert_array_equal(actions(agent, states[:, rows]), together[:, rows])


def test_an_agent_that_draws_for_all_rows_promises_nothing():
    assert not hasattr(Random().agent(0), "rows_are_independent")
