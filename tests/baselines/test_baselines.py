"""The contract of every agent that needs no training, and the actions of EXP, REFLEX and the floors."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import pytest

from baselines.exp import Exp
from baselines.floors import Nothing, Random
from baselines.omega import OmegaAgent
from baselines.reflex import Reflex
from dextron_bench.errors import BadInput
from dextron_bench.experts.policies import Expert
from dextron_bench.methods.agents import Agent, Privileged
from dextron_bench.world import model, task
from tests.helpers import fixed_success_model

KINDS: dict[str, Callable[[], Agent]] = {  # The agents of methods that need no training.
    "exp": lambda: Exp().agent(0),
    "nothing": lambda: Nothing().agent(0),
    "omega": lambda: OmegaAgent(fixed_success_model.model(0.4), 0.02, 0.08),
    "reflex": lambda: Reflex().agent(0),
    "random": lambda: Random().agent(0),
}


def states(n: int) -> np.ndarray:
    """States (n, 48) of half-closed hands, 0.1 to 0.4 m from the bottle."""
    rows = np.zeros((n, model.STATE))
    rows[:, :25] = model.initial_qpos()
    rows[:, 7] = np.linspace(-0.1, -0.4, n)
    return rows


@pytest.mark.parametrize("name", KINDS)
def test_every_agent_follows_the_contract(name: str):
    agent = KINDS[name]()
    batch = states(5)
    before = batch.copy()
    if name == "exp":
        cast(Privileged, agent).assign(np.arange(5), [Expert(1.2, 0.5)] * 5)
    agent.reset(np.arange(5))
    for _ in range(3):
        actions = agent.act(batch)
        assert actions.shape == (5, 1)
        assert actions.dtype == np.float64
        assert (np.abs(actions) <= 1.0).all()
    np.testing.assert_array_equal(batch, before)


def test_only_exp_receives_the_experts():
    assert [name for name, make in KINDS.items() if isinstance(make(), Privileged)] == ["exp"]


def test_exp_plays_the_expert_of_each_row():
    agent, row = Exp().agent(0), np.arange(2)
    agent.assign(row, [Expert(1.0, 0.01), Expert(1.5, 0.9)])
    agent.reset(row)
    batch = states(2)
    batch[1] = batch[0]
    np.testing.assert_array_equal(agent.act(batch), [[0.0], [0.0]])
    # Half closed, still at the first distance: both experts open with K (0 - 0.5).
    np.testing.assert_allclose(agent.act(batch), [[-0.5], [-0.75]])


def test_nothing_sends_zeros_and_random_sends_uniform_noise():
    assert not Nothing().agent(0).act(states(3)).any()
    noise = Random().agent(0).act(states(4000))
    assert abs(noise.mean()) < 0.04  # 4 sigma of the mean is 0.037.
    assert noise.min() < -0.99
    assert noise.max() > 0.99


def test_reflex_closes_from_its_distance_on_and_does_not_reopen():
    near, away = states(2), states(2)  # The first row at 0.1 m from the bottle in x, the second further.
    far = float(task.distance(near)[0])
    away[:, 7] -= 0.5
    agent = Reflex(near=far).agent(0)
    agent.reset(np.arange(2))
    played = [agent.act(batch)[:, 0].tolist() for batch in (away, near, away)]
    assert played == [[-1.0, -1.0], [1.0, -1.0], [1.0, -1.0]]
    agent.reset(np.array([0]))
    assert agent.act(away)[0, 0] == -1.0
    with pytest.raises(BadInput, match="0 or more"):
        Reflex(near=float("nan"))
