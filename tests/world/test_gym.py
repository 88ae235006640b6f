"""The Gymnasium environments: the contracts of single and vector ones, and bit-equality with the engine."""

from __future__ import annotations

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import dextron_bench  # noqa: F401  # Registers the environments.
from dextron_bench.world import task
from dextron_bench.world.environment import ActionError
from dextron_bench.world.gym import GraspEnv, GraspVectorEnv
from tests.helpers.short_reaches import SETTINGS, SOURCE, actions, played

ID = "dextron_bench/Grasp-v0"


def test_the_registered_environment_passes_gymnasiums_checks_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(ID, reaches=SOURCE)
        check_env(env.unwrapped, skip_render_check=True)
        env.reset(seed=0)
        env.step(env.action_space.sample())


def test_the_rendered_picture_changes_with_the_state():
    env = GraspEnv(SOURCE, [SETTINGS[3]], render_mode="rgb_array")
    env.reset()
    before = env.render()
    for action in actions(3)[:40]:
        env.step(action)
    after = env.render()
    assert before is not None
    assert after is not None
    assert before.shape == after.shape == (360, 480, 3)
    assert before.dtype == np.uint8
    assert (before != after).mean() > 0.01
    assert GraspEnv(SOURCE).render() is None


def test_whole_episodes_are_bit_equal_to_those_of_the_engine():
    env = GraspEnv(SOURCE, SETTINGS)
    for k, setting in enumerate(SETTINGS):
        state, info = env.reset()
        assert info == {"setting": setting, "episode_return": 0.0, "is_success": False}
        reference, score = played(k), 0.0
        assert state.tobytes() == reference.states[0].tobytes()
        ended = False, False
        for t, expected in enumerate(reference.rewards):
            assert ended == (False, False)
            state, reward, *ended, info = env.step(actions(k)[t])
            ended = tuple(ended)
            score += reward
            assert state.tobytes() == reference.states[t + 1].tobytes()
            assert reward == expected
            assert info["episode_return"] == score
        assert ended == (reference.terminated, reference.truncated)
        assert info["is_success"] == (reference.rewards.sum() == task.SUCCESS)


def test_a_reset_can_take_a_setting():
    env = GraspEnv(SOURCE, SETTINGS)
    state, info = env.reset(options={"setting": SETTINGS[4]})
    assert info["setting"] == SETTINGS[4]
    assert state.tobytes() == played(4).states[0].tobytes()
    assert env.reset()[1]["setting"] == SETTINGS[0]


def test_a_seed_returns_to_the_first_setting():
    env = GraspEnv(SOURCE, SETTINGS)
    env.reset(seed=1)
    assert env.reset()[1]["setting"] == SETTINGS[1]
    assert env.reset(seed=1)[1]["setting"] == SETTINGS[0]


def test_a_step_outside_an_episode_raises_reset_needed():
    env = GraspEnv(SOURCE, [SETTINGS[2]])
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step(np.zeros(1))
    env.reset()
    for action in actions(2)[: len(played(2).rewards)]:
        env.step(action)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(1))
    with pytest.raises(ResetNeeded):
        GraspVectorEnv(2, SOURCE).step(np.zeros((2, 1)))


@pytest.mark.parametrize("action", [[np.nan], [np.nextafter(1.0, 2.0)], [-np.inf], [0.0, 0.0], 0.5, None])
def test_an_invalid_action_is_refused_and_changes_nothing(action: object):
    env = GraspEnv(SOURCE, [SETTINGS[0]])
    env.reset()
    with pytest.raises(ActionError, match=r"actions must"):
        env.step(action)  # pyright: ignore[reportArgumentType]
    state = env.step(actions(0)[0])[0]
    assert state.tobytes() == played(0).states[1].tobytes()


def test_one_invalid_action_among_many_is_refused():
    env = GraspVectorEnv(3, SOURCE)
    env.reset(seed=0)
    with pytest.raises(ActionError, match=r"lie in \[-1, 1\].*got 1.5"):
        env.step(np.array([[0.0], [1.5], [0.0]]))
    with pytest.raises(ActionError, match=r"shape \(3, 1\); got \(3,\)"):
        env.step(np.zeros(3))


def test_make_vec_returns_the_vector_environment_and_its_autoreset_mode():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make_vec(ID, num_envs=4, reaches=SOURCE, threads=2)
    assert isinstance(env, GraspVectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert env.observation_space.shape == (4, 48)
    assert env.action_space.shape == (4, 1)
    states, infos = env.reset(seed=3)
    assert states in env.observation_space
    assert infos["setting"].shape == (4,)
    states, *_ = env.step(env.action_space.sample())
    assert states in env.observation_space


def test_the_vector_environment_agrees_with_single_ones():
    rng = np.random.default_rng(0)
    vector, singles = GraspVectorEnv(3, SOURCE, threads=2), SyncVectorEnv([lambda: GraspEnv(SOURCE)] * 3)
    assert_same(vector.reset(seed=9), singles.reset(seed=9))
    ended = 0
    for _ in range(130):
        commands = rng.uniform(-1.0, 1.0, (3, 1))
        step = vector.step(commands)
        assert_same(step, singles.step(commands))
        ended += int((step[2] | step[3]).sum())
    assert ended >= 3  # Slots have begun new episodes.
    assert_same(vector.reset(), singles.reset())


def assert_same(one: tuple, other: tuple) -> None:
    """Asserts that the arrays of two resets or steps agree in every bit, and that their infos agree."""
    for a, b in zip(one[:-1], other[:-1], strict=True):
        assert a.tobytes() == b.tobytes()
        assert a.dtype == b.dtype
    assert one[-1].keys() == other[-1].keys()
    for key, values in one[-1].items():
        assert values.tolist() == other[-1][key].tolist()
        assert values.dtype == other[-1][key].dtype


def test_each_free_slot_takes_the_next_setting_of_the_list():
    env = GraspVectorEnv(2, SOURCE, SETTINGS[2:], threads=1)
    _, infos = env.reset()
    assert infos["setting"].tolist() == [SETTINGS[2], SETTINGS[3]]
    length = len(played(2).rewards)
    for t in range(length - 1):
        env.step(np.stack([actions(2)[t], actions(3)[t]]))
    states, _, terminated, _, _ = env.step(np.stack([actions(2)[length - 1], actions(3)[length - 1]]))
    assert terminated.tolist() == [True, False]
    assert states[0].tobytes() == played(2).states[-1].tobytes()
    states, rewards, terminated, _, infos = env.step(np.stack([actions(2)[0], actions(3)[length]]))
    assert infos["setting"].tolist() == [SETTINGS[4], SETTINGS[3]]
    assert (rewards.tolist(), terminated.tolist()) == ([0.0, 0.0], [False, False])
    assert states[0].tobytes() == played(4).states[0].tobytes()
    assert states[1].tobytes() == played(3).states[length + 1].tobytes()


def test_returned_arrays_of_the_vector_environment_do_not_change_later():
    env = GraspVectorEnv(2, SOURCE)
    states, infos = env.reset(seed=0)
    kept, returns = states.copy(), infos["episode_return"].copy()
    for _ in range(3):
        env.step(np.ones((2, 1)))
    np.testing.assert_array_equal(states, kept)
    np.testing.assert_array_equal(infos["episode_return"], returns)
