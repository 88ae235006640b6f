"""The Gymnasium face: registration, the contracts of single and vector environments, and bits equal to the engine's."""

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


def test_render_gives_a_picture_that_changes_with_the_state():
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


def test_no_bit_differs_from_the_engine_over_whole_episodes():
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


def test_a_setting_can_be_asked_for():
    env = GraspEnv(SOURCE, SETTINGS)
    state, info = env.reset(options={"setting": SETTINGS[4]})
    assert info["setting"] == SETTINGS[4]
    assert state.tobytes() == played(4).states[0].tobytes()
    assert env.reset()[1]["setting"] == SETTINGS[0]


def test_a_seed_goes_back_to_the_first_setting():
    env = GraspEnv(SOURCE, SETTINGS)
    env.reset(seed=1)
    assert env.reset()[1]["setting"] == SETTINGS[1]
    assert env.reset(seed=1)[1]["setting"] == SETTINGS[0]


def test_a_step_outside_an_episode_asks_for_a_reset():
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
def test_a_bad_action_is_refused_and_changes_nothing(action: object):
    env = GraspEnv(SOURCE, [SETTINGS[0]])
    env.reset()
    with pytest.raises(ActionError, match=r"actions must"):
        env.step(action)  # pyright: ignore[reportArgumentType]
    state = env.step(actions(0)[0])[0]
    assert state.tobytes() == played(0).states[1].tobytes()


def test_a_bad_action_among_many_is_refused():
    env = GraspVectorEnv(3, SOURCE)
    env.reset(seed=0)
    with pytest.raises(ActionError, match=r"lie in \[-1, 1\].*got 1.5"):
        env.step(np.array([[0.0], [1.5], [0.0]]))
    with pytest.raises(ActionError, match=r"shape \(3, 1\); got \(3,\)"):
        env.step(np.zeros(3))


def test_the_vector_environment_is_made_by_name_and_says_how_it_resets():
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


def test_the_vector_environment_equals_as_many_single_ones():
    rng = np.random.default_rng(0)
    ours, theirs = GraspVectorEnv(3, SOURCE, threads=2), SyncVectorEnv([lambda: GraspEnv(SOURCE)] * 3)
    assert_same(ours.reset(seed=9), theirs.reset(seed=9))
    over = 0
    for _ in range(130):
        commands = rng.uniform(-1.0, 1.0, (3, 1))
        step = ours.step(commands)
        assert_same(step, theirs.step(commands))
        over += int((step[2] | step[3]).sum())
    assert over >= 3  # So that slots have begun anew.
    assert_same(ours.reset(), theirs.reset())


def assert_same(one: tuple, other: tuple) -> None:
    """Arrays of two resets or steps agree bit for bit, and so do their infos."""
    for a, b in zip(one[:-1], other[:-1], strict=True):
        assert a.tobytes() == b.tobytes()
        assert a.dtype == b.dtype
    assert one[-1].keys() == other[-1].keys()
    for key, values in one[-1].items():
        assert values.tolist() == other[-1][key].tolist()
        assert values.dtype == other[-1][key].dtype


def test_a_list_of_settings_is_dealt_as_slots_fall_free():
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


def test_what_the_vector_environment_returned_does_not_change_later():
    env = GraspVectorEnv(2, SOURCE)
    states, infos = env.reset(seed=0)
    kept, returns = states.copy(), infos["episode_return"].copy()
    for _ in range(3):
        env.step(np.ones((2, 1)))
    np.testing.assert_array_equal(states, kept)
    np.testing.assert_array_equal(infos["episode_return"], returns)
