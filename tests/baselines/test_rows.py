"""Agents that promise independent rows: any rows together give the actions that all rows together give."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from baselines import floors
from baselines.floors import Nothing, Random
from baselines.omega import Omega
from baselines.policy import MeanAgent
from baselines.reflex import Reflex
from dextron_bench.methods.agents import Agent
from dextron_bench.storage import tensors
from tests.helpers.short_reaches import SETTINGS, played

WEIGHTS = Path(floors.__file__).parent / "weights"
AGENTS = (
    lambda: Nothing().agent(0),
    lambda: Reflex().agent(0),
    lambda: Omega().for_source("synthetic").agent(0),
    lambda: MeanAgent(tensors.read(WEIGHTS / "rlil-0.1-quick" / "synthetic" / "seed0.safetensors")),
)


def actions(agent: Agent, states: np.ndarray) -> np.ndarray:
    """Actions (T, N) for states (T, N, 48) of episodes that begin together."""
    agent.reset(np.arange(states.shape[1]))
    return np.stack([agent.act(batch)[:, 0] for batch in states])


@pytest.mark.parametrize("make", AGENTS)
def test_rows_are_independent(make: Callable[[], Agent]):
    assert getattr(make(), "rows_are_independent", False)
    episodes = [played(k).states for k in range(len(SETTINGS))]
    steps = min(map(len, episodes))
    states = np.stack([episode[:steps] for episode in episodes], axis=1)
    together = actions(make(), states)
    for rows in ([0], [3, 1], [4, 2]):
        np.testing.assert_array_equal(actions(make(), states[:, rows]), together[:, rows])


def test_an_agent_that_draws_for_all_rows_promises_nothing():
    assert not hasattr(Random().agent(0), "rows_are_independent")
