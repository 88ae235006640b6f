"""The rule for actions, which is the same in every environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.wrappers import vector as vector_wrappers

import dextron_bench
from dextron_bench.world import model
from tests.helpers.short_reaches import SETTINGS, SOURCE, TORN, TORN_POSE, TornSource

ID = "dextron_bench/Grasp-v0"
RANGES = [(low, high, dtype) for low, high in ((-0.1, 0.2), (-3.1, 0.7), (0.0, 1e4)) for dtype in ("f4", "f8")]


@pytest.mark.parametrize(("low", "high", "dtype"), RANGES)
def test_both_ends_of_a_rescaled_range_are_actions(low: float, high: float, dtype: str):
    ends = np.array([low, high], dtype)
    single = wrappers.RescaleAction(gymnasium.make(ID, reaches=SOURCE), ends[0], ends[1])
    vector = vector_wrappers.RescaleAction(gymnasium.make_vec(ID, 2, reaches=SOURCE), ends[0], ends[1])
    single.reset(seed=0)
    vector.reset(seed=0)
    for end in ends:
        single.step(np.full(1, end, dtype))
        vector.step(np.full((2, 1), end, dtype))


@pytest.mark.parametrize("excess", [1e-15, 1e-7, 1e-6])
def test_an_action_that_rounding_put_outside_the_range_is_clipped_everywhere(excess: float):
    single, vector = (gymnasium.make(ID, reaches=SOURCE), gymnasium.make_vec(ID, 1, reaches=SOURCE))
    suite = dextron_bench.load_environment(SOURCE, seed=0)
    for sign in (1.0, -1.0):
        for env, shape in ((single, (1,)), (vector, (1, 1))):
            env.reset(seed=0)
            beyond = env.step(np.full(shape, sign * (1.0 + excess)))[0]
            env.reset(seed=0)
            assert beyond.tobytes() == env.step(np.full(shape, sign))[0].tobytes()
        suite.reset()
        suite.step(np.full(1, sign * (1.0 + excess)))
        np.testing.assert_array_equal(suite.physics.data.ctrl[1:], sign * model.command_gain())


@pytest.mark.parametrize("action", [1.0000020001, -1.0000010001])
def test_the_error_for_an_action_outside_the_range_has_all_its_digits(action: float):
    environments = (gymnasium.make(ID, reaches=SOURCE), gymnasium.make_vec(ID, 1, reaches=SOURCE))
    for env, shape in zip(environments, ((1,), (1, 1)), strict=True):
        env.reset(seed=0)
        with pytest.raises(ValueError, match=f"got {action!r}$"):
            env.step(np.full(shape, action))
    suite = dextron_bench.load_environment(SOURCE, seed=0)
    suite.reset()
    with pytest.raises(ValueError, match=f"got {action!r}$"):
        suite.step(np.full(1, action))


@pytest.mark.parametrize("action", [["0.5"], [1j], [None], [[0.5, [0.5]]], np.array(["close"]), {}])
def test_what_is_no_number_is_no_action(action: Any):
    env = gymnasium.make(ID, reaches=SOURCE, disable_env_checker=True)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="actions must"):
        env.step(action)


@pytest.mark.parametrize(
    "action", [np.array([0.5], np.float32), [0.5], (0.5,), np.array([1], np.int8), np.array([True])]
)
def test_numbers_of_every_type_are_actions(action: Any):
    env = gymnasium.make(ID, reaches=SOURCE, disable_env_checker=True)
    env.reset(seed=0)
    env.step(action)


def test_the_action_of_a_slot_that_begins_is_ignored():
    env = gymnasium.make_vec(ID, 2, reaches=TornSource(), settings=[TORN, SETTINGS[0]])
    env.reset()
    ended = [env.step(np.zeros((2, 1)))[2].tolist() for _ in range(TORN_POSE)]
    assert ended[-1] == [True, False]
    env.step(np.array([[np.nan], [0.0]]))
    with pytest.raises(ValueError, match="got nan"):
        env.step(np.array([[np.nan], [0.0]]))
