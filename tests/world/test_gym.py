"""The Gymnasium environment: its contract, and bit-equality with the engine."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import dextron_bench  # noqa: F401  # Registers the environments.
from dextron_bench.errors import BadInput
from dextron_bench.reaches.setting import plain
from dextron_bench.world import task
from dextron_bench.world.gym import GraspEnv, GraspVectorEnv
from tests.helpers.short_reaches import SETTINGS, SOURCE, TORN, TORN_POSE, TornSource, actions, played

ID = "dextron_bench/Grasp-v0"


def test_the_registered_environment_passes_gymnasiums_checks_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(ID, reaches=SOURCE)
        check_env(env.unwrapped, skip_render_check=True)
        env.reset(seed=0)
        env.step(env.action_space.sample())


@pytest.mark.slow
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
        assert info == {"setting": plain(setting), "episode_return": 0.0, "is_success": False, "failure": ""}
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
    assert info["setting"] == plain(SETTINGS[4])
    assert state.tobytes() == played(4).states[0].tobytes()
    assert env.reset()[1]["setting"] == plain(SETTINGS[0])


def test_a_seed_returns_to_the_first_setting():
    env = GraspEnv(SOURCE, SETTINGS)
    env.reset(seed=1)
    assert env.reset()[1]["setting"] == plain(SETTINGS[1])
    assert env.reset(seed=1)[1]["setting"] == plain(SETTINGS[0])


def test_a_step_outside_an_episode_raises_reset_needed():
    env = GraspEnv(SOURCE, [SETTINGS[2]])
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step(np.zeros(1))
    env.reset()
    for action in actions(2)[: len(played(2).rewards)]:
        env.step(action)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(1))


@pytest.mark.parametrize("action", [[np.nan], [1.0 + 1.1e-6], [-np.inf], [0.0, 0.0], 0.5, None])
def test_an_invalid_action_is_refused_and_changes_nothing(action: object):
    env = GraspEnv(SOURCE, [SETTINGS[0]])
    env.reset()
    with pytest.raises(BadInput, match=r"actions must"):
        env.step(action)  # pyright: ignore[reportArgumentType]
    state = env.step(actions(0)[0])[0]
    assert state.tobytes() == played(0).states[1].tobytes()


@pytest.mark.parametrize("value", [0, "a", {}, ("a", 0.0, 0.0, 0.0), False])
def test_a_setting_that_is_none_is_refused(value: object):
    with pytest.raises(BadInput, match="must be a dextron_bench Setting; got"):
        GraspEnv(SOURCE).reset(options={"setting": value})
    with pytest.raises((BadInput, ValueError)):
        GraspVectorEnv(2, SOURCE).reset(options={"setting": value})
    with pytest.raises(BadInput, match="must be a dextron_bench Setting; got"):
        GraspEnv(SOURCE, [SETTINGS[0], value])  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("integer", [np.int64, np.uint8])
def test_a_seed_may_be_a_numpy_integer(integer: Callable[[int], Any]):
    single, vector = GraspEnv(SOURCE), GraspVectorEnv(2, SOURCE)
    expected = single.reset(seed=3)[1], vector.reset(seed=3)[1]["setting"]["offset_x"].tolist()
    assert single.reset(seed=integer(3))[1] == expected[0]
    assert vector.reset(seed=integer(3))[1]["setting"]["offset_x"].tolist() == expected[1]
    assert vector.reset(seed=np.array([3, 4]))[1]["setting"]["offset_x"].tolist() == expected[1]  # pyright: ignore[reportArgumentType]


def test_a_copy_of_an_environment_continues_its_episode(copied: Callable[[Any], Any]):
    env = gymnasium.make(ID, reaches=SOURCE, settings=SETTINGS)
    env.reset(seed=0, options={"setting": SETTINGS[3]})
    for t in range(70):
        env.step(actions(3)[t])
    other = copied(env)
    for one in (other, env):  # One after the other: they share nothing.
        info = {}
        for t in range(70, len(played(3).rewards)):
            state, reward, _, _, info = one.step(actions(3)[t])
            assert state.tobytes() == played(3).states[t + 1].tobytes()
            assert reward == played(3).rewards[t]
        assert info["episode_return"] == played(3).rewards.sum()
        assert one.reset()[1]["setting"] == plain(SETTINGS[0])


def test_a_simulation_that_diverges_is_terminated_and_named():
    single = GraspEnv(TornSource(), [TORN])
    single.reset()
    for _ in range(TORN_POSE - 1):
        assert single.step(np.zeros(1))[-1]["failure"] == ""
    state, reward, terminated, truncated, info = single.step(np.zeros(1))
    assert (reward, terminated, truncated) == (0.0, True, False)
    assert info["failure"] == "the simulation diverged"
    assert state in single.observation_space
    with pytest.raises(ResetNeeded):
        single.step(np.zeros(1))


@pytest.mark.slow
def test_gymnasium_records_a_video(tmp_path: Path):
    pytest.importorskip("moviepy", reason="RecordVideo needs MoviePy")
    av = pytest.importorskip("av")
    env = gymnasium.make(ID, reaches=SOURCE, settings=[SETTINGS[2]], render_mode="rgb_array")
    with gymnasium.wrappers.RecordVideo(env, str(tmp_path / "videos"), video_length=8) as recorded:
        recorded.reset(seed=0)
        for t in range(10):
            recorded.step(actions(2)[t])
    with av.open(str(tmp_path / "videos" / "rl-video-episode-0.mp4")) as video:
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert len(frames) in (8, 9)  # With or without the first state.
    assert frames[0].shape == (360, 480, 3)
    assert frames[0].std() > 10.0  # A picture, not one colour.
    assert (frames[0] != frames[-1]).any()
