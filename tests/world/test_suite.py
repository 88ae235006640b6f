"""The dm_control environment: the contract of an environment, and bit-equality with the engine."""

from __future__ import annotations

from collections.abc import Iterator

import dm_env
import numpy as np
import pytest
from dm_control.rl import control

from dextron_bench.errors import BadInput
from dextron_bench.reaches.sources import UnknownSource
from dextron_bench.world import model, suite
from dextron_bench.world.engine import STATE_BOUND
from tests.helpers.short_reaches import SETTINGS, SOURCE, TORN, TORN_POSE, TornSource, actions, played


def episode(env: control.Environment, rng: np.random.Generator) -> Iterator[dm_env.TimeStep]:
    """Yields the time steps of one episode with random actions."""
    step = env.reset()
    yield step
    while not step.last():
        step = env.step(rng.uniform(-1.0, 1.0, 1))
        yield step


def episode_states(env: control.Environment) -> np.ndarray:
    """The states (T, 48) of one episode, with the same random actions in each call."""
    return np.array([step.observation["state"] for step in episode(env, np.random.default_rng(5))])


@pytest.fixture
def env() -> control.Environment:
    """An environment that draws settings from the short reaches."""
    return suite.load(SOURCE, seed=1)


def test_the_specs_are_48_numbers_and_one_speed(env: control.Environment):
    assert list(env.observation_spec()) == ["state"]
    assert env.observation_spec()["state"].shape == (model.STATE,)
    action = env.action_spec()
    assert (action.shape, action.minimum, action.maximum) == ((1,), -1.0, 1.0)
    assert env.control_timestep() == pytest.approx(0.02)


def test_every_step_of_an_episode_meets_the_specs(env: control.Environment):
    steps = list(episode(env, np.random.default_rng(0)))
    for step in steps:
        env.observation_spec()["state"].validate(step.observation["state"])
        assert np.isfinite(step.observation["state"]).all()
    assert steps[0].first()
    assert steps[0].reward is None
    assert steps[0].discount is None
    assert all(step.mid() and step.discount == 1.0 for step in steps[1:-1])
    assert all(step.reward in (0.0, 1.0) for step in steps[1:])
    assert steps[-1].discount in (0.0, 1.0)


def test_a_step_after_the_last_one_begins_an_episode(env: control.Environment):
    list(episode(env, np.random.default_rng(0)))
    assert env.step(np.zeros(1)).first()
    assert env.step(np.zeros(1)).mid()


def test_the_first_step_of_a_new_environment_begins_an_episode():
    assert suite.load(SOURCE, seed=1).step(np.zeros(1)).first()


def test_equal_seeds_give_equal_episodes_and_other_seeds_do_not():
    one, same, other = (suite.load(SOURCE, seed=seed) for seed in (3, 3, 4))
    assert episode_states(one).tobytes() == episode_states(same).tobytes()
    assert one.task.setting == same.task.setting  # pyright: ignore[reportAttributeAccessIssue]
    assert one.reset().observation["state"].tobytes() != other.reset().observation["state"].tobytes()


def test_an_episode_after_a_reset_does_not_depend_on_earlier_ones():
    env = suite.load(SOURCE, [SETTINGS[3]])
    first = episode_states(env)
    env.reset()
    for _ in range(30):
        env.step(np.ones(1))
    env.physics.data.qfrc_applied[:] = 1.0
    env.physics.data.qacc_warmstart[:] = 9.0
    assert episode_states(env).tobytes() == first.tobytes()


def test_a_reset_does_not_change_the_shared_start_pose(env: control.Environment):
    before = model.initial_qpos().copy()
    env.reset()
    np.testing.assert_array_equal(model.initial_qpos(), before)


def test_observation_does_not_change_the_physics(env: control.Environment):
    env.reset()
    env.step(np.ones(1))
    before = env.physics.get_state()
    env.task.get_observation(env.physics)
    env.task.get_reward(env.physics)
    env.task.get_termination(env.physics)
    np.testing.assert_array_equal(env.physics.get_state(), before)


def test_returned_states_do_not_change_later(env: control.Environment):
    step = env.reset()
    kept = step.observation["state"].copy()
    env.step(np.ones(1))
    np.testing.assert_array_equal(step.observation["state"], kept)


def test_whole_episodes_are_bit_equal_to_those_of_the_engine():
    env = suite.load(SOURCE, SETTINGS)
    for k, setting in enumerate(SETTINGS):
        step, reference = env.reset(), played(k)
        assert env.task.setting == setting  # pyright: ignore[reportAttributeAccessIssue]
        assert step.observation["state"].tobytes() == reference.states[0].tobytes()
        for t, reward in enumerate(reference.rewards):
            step = env.step(actions(k)[t])
            assert step.observation["state"].tobytes() == reference.states[t + 1].tobytes()
            assert step.reward == reward
            assert step.last() == (t == len(reference.rewards) - 1)
        assert step.discount == (0.0 if reference.terminated else 1.0)


@pytest.mark.slow
def test_settings_are_played_in_turn_again_and_again():
    env = suite.load(SOURCE, SETTINGS[:2])
    settings = []
    for _ in range(4):
        env.reset()
        settings.append(env.task.setting)  # pyright: ignore[reportAttributeAccessIssue]
    assert settings == [*SETTINGS[:2], *SETTINGS[:2]]


@pytest.mark.parametrize("action", [[np.nan], [1.0 + 1.1e-6], [-2.0], [0.0, 0.0], 0.5, ["close"]])
def test_a_bad_action_is_refused(env: control.Environment, action: object):
    env.reset()
    with pytest.raises(BadInput, match=r"actions must"):
        env.step(action)


def test_errors_for_invalid_arguments_list_the_valid_ones():
    with pytest.raises(UnknownSource, match="choose from minjerk, real, synthetic"):
        suite.load("sintetic")
    with pytest.raises(ValueError, match="empty list"):
        suite.load(SOURCE, [])


def test_a_simulation_that_diverges_ends_its_episode_with_a_named_failure():
    env = suite.load(TornSource(), [TORN, SETTINGS[3]])
    env.reset()
    steps = [env.step(np.zeros(1)) for _ in range(TORN_POSE)]
    assert [step.last() for step in steps] == [False] * (TORN_POSE - 1) + [True]
    assert (steps[-1].reward, steps[-1].discount) == (0.0, 0.0)
    assert np.isfinite(steps[-1].observation["state"]).all()
    assert env.task.failure == "the simulation diverged"  # pyright: ignore[reportAttributeAccessIssue]
    step = env.reset()
    assert env.task.failure == ""  # pyright: ignore[reportAttributeAccessIssue]
    for t, reward in enumerate(played(3).rewards):
        assert step.observation["state"].tobytes() == played(3).states[t].tobytes()
        step = env.step(actions(3)[t])
        assert step.reward == reward
    assert step.last()


def test_a_number_beyond_the_bound_after_the_last_physics_step_is_a_divergence():
    physics = suite.Physics.load()
    physics.data.qvel[2] = 0.9999 * STATE_BOUND  # [m/s] of the bottle: 1e10 m in 50 control steps.
    diverged = []
    for _ in range(52):
        physics.step(model.substeps())
        diverged.append(physics.diverged)
        assert np.abs(physics.states()).max() <= STATE_BOUND
    assert diverged.index(True) >= 45
    assert sum(diverged) == 1
