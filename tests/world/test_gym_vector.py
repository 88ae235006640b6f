"""The vector environment agrees with Gymnasium's own one over single environments, and with the engine."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

import dextron_bench  # noqa: F401  # Registers the environments.
from dextron_bench.reaches.setting import Setting
from dextron_bench.world.environment import ActionError
from dextron_bench.world.gym import GraspEnv, GraspVectorEnv
from tests.helpers.short_reaches import SETTINGS, SOURCE, TORN, TORN_POSE, TornSource, actions, played

ID = "dextron_bench/Grasp-v0"


def sync_vector(count: int, **options: Any) -> SyncVectorEnv:
    """Gymnasium's own vector environment, with single environments of short reaches."""
    return SyncVectorEnv([lambda: GraspEnv(SOURCE)] * count, **options)


def assert_same_steps(vector: VectorEnv, singles: VectorEnv, count: int) -> int:
    """Asserts that random steps of two vector environments agree; returns the number of episodes that ended."""
    rng, ended = np.random.default_rng(0), 0
    for _ in range(count):
        commands = rng.uniform(-1.0, 1.0, (vector.num_envs, 1))
        step = vector.step(commands)
        assert_same(step, singles.step(commands))
        ended += int((step[2] | step[3]).sum())
    return ended


def assert_same(one: tuple, other: tuple) -> None:
    """Asserts that the arrays of two resets or steps agree in every bit, and that their infos agree."""
    for a, b in zip(one[:-1], other[:-1], strict=True):
        assert a.tobytes() == b.tobytes()
        assert a.dtype == b.dtype
    assert_same_info(one[-1], other[-1])


def assert_same_info(one: dict[str, Any], other: dict[str, Any]) -> None:
    """Asserts that two infos have equal entries of equal types."""
    assert one.keys() == other.keys()
    for key, values in one.items():
        if isinstance(values, dict):
            assert_same_info(values, other[key])
            continue
        assert str(values.tolist()) == str(other[key].tolist())
        assert values.dtype == other[key].dtype


def settings(infos: dict[str, Any]) -> list[Setting]:
    """The settings in the info of a vector environment."""
    columns = [infos["setting"][field.name].tolist() for field in fields(Setting)]
    return [Setting(*row) for row in zip(*columns, strict=True)]


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
    assert infos["setting"]["reach"].shape == (4,)
    states, *_ = env.step(env.action_space.sample())
    assert states in env.observation_space


def test_the_vector_environment_agrees_with_single_ones():
    vector, singles = GraspVectorEnv(3, SOURCE, threads=2), sync_vector(3)
    assert_same(vector.reset(seed=9), singles.reset(seed=9))
    assert assert_same_steps(vector, singles, 130) >= 3  # Slots have begun new episodes.
    assert_same(vector.reset(), singles.reset())


def test_each_free_slot_takes_the_next_setting_of_the_list():
    env = GraspVectorEnv(2, SOURCE, SETTINGS[2:], threads=1)
    _, infos = env.reset()
    assert settings(infos) == [SETTINGS[2], SETTINGS[3]]
    length = len(played(2).rewards)
    for t in range(length - 1):
        env.step(np.stack([actions(2)[t], actions(3)[t]]))
    states, _, terminated, _, _ = env.step(np.stack([actions(2)[length - 1], actions(3)[length - 1]]))
    assert terminated.tolist() == [True, False]
    assert states[0].tobytes() == played(2).states[-1].tobytes()
    states, rewards, terminated, _, infos = env.step(np.stack([actions(2)[0], actions(3)[length]]))
    assert settings(infos) == [SETTINGS[4], SETTINGS[3]]
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


@pytest.mark.parametrize("mask", [[True, False, True], [False, True, False], [True, True, True]])
@pytest.mark.parametrize("seed", [None, 4, [5, None, 6]])
@pytest.mark.parametrize("setting", [None, SETTINGS[1]])
def test_a_reset_mask_resets_the_same_slots_as_in_gymnasium(mask: list[bool], seed: Any, setting: Setting | None):
    vector, singles = GraspVectorEnv(3, SOURCE, threads=1), sync_vector(3)
    assert_same(vector.reset(seed=9), singles.reset(seed=9))
    assert_same_steps(vector, singles, 5)
    options = {"reset_mask": np.array(mask)} | ({"setting": setting} if setting else {})
    assert_same(vector.reset(seed=seed, options=dict(options)), singles.reset(seed=seed, options=dict(options)))
    assert_same_steps(vector, singles, 5)


def test_every_slot_can_be_reset_to_one_setting_or_to_its_own():
    env = GraspVectorEnv(3, SOURCE, SETTINGS, threads=1)
    states, infos = env.reset(options={"setting": SETTINGS[4]})
    assert settings(infos) == [SETTINGS[4]] * 3
    assert states[2].tobytes() == played(4).states[0].tobytes()
    states, infos = env.reset(options={"setting": [SETTINGS[2], None, SETTINGS[3]]})
    assert settings(infos) == [SETTINGS[2], SETTINGS[0], SETTINGS[3]]
    for k, index in enumerate((2, 0, 3)):
        assert states[k].tobytes() == played(index).states[0].tobytes()


@pytest.mark.parametrize(
    ("mask", "error", "message"),
    [
        ([True, False], TypeError, "NumPy array of bool"),
        (np.array([1, 0]), TypeError, "NumPy array of bool"),
        (np.array([True]), ValueError, r"shape \(2,\); got \(1,\)"),
        (np.zeros(2, bool), ValueError, "at least one slot"),
    ],
)
def test_a_reset_mask_of_another_form_is_refused_as_in_gymnasium(mask: Any, error: type[Exception], message: str):
    for env in (GraspVectorEnv(2, SOURCE), sync_vector(2)):
        env.reset(seed=0)
        with pytest.raises((error, AssertionError)):  # Gymnasium 1.2 asserts.
            env.reset(options={"reset_mask": mask})
    with pytest.raises(error, match=message):
        GraspVectorEnv(2, SOURCE).reset(options={"reset_mask": mask})


def test_the_first_reset_begins_an_episode_in_every_slot():
    env = GraspVectorEnv(2, SOURCE)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros((2, 1)))
    with pytest.raises(ResetNeeded, match="without a reset_mask"):
        env.reset(options={"reset_mask": np.array([True, False])})


@pytest.mark.slow
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_the_autoreset_modes_agree_with_gymnasiums(mode: AutoresetMode):
    vector = gymnasium.make_vec(ID, num_envs=3, reaches=SOURCE, autoreset_mode=mode.value)
    singles = sync_vector(3, autoreset_mode=mode)
    assert vector.metadata["autoreset_mode"] is mode
    assert_same(vector.reset(seed=9), singles.reset(seed=9))
    assert assert_same_steps(vector, singles, 130) >= 3


def test_without_autoreset_a_slot_waits_for_its_reset():
    vector = gymnasium.make_vec(ID, num_envs=2, reaches=SOURCE, autoreset_mode=AutoresetMode.DISABLED)
    singles = sync_vector(2, autoreset_mode="Disabled")
    assert_same(vector.reset(seed=9), singles.reset(seed=9))
    ended = 0
    for _ in range(130):
        step = vector.step(np.full((2, 1), 0.5))
        assert_same(step, singles.step(np.full((2, 1), 0.5)))
        if (over := step[2] | step[3]).any():
            ended += int(over.sum())
            with pytest.raises(ResetNeeded, match="are over; reset them with"):
                vector.step(np.zeros((2, 1)))
            assert_same(*[env.reset(options={"reset_mask": over}) for env in (vector, singles)])
    assert ended >= 2
    with pytest.raises(ValueError, match="Sometimes"):
        GraspVectorEnv(2, SOURCE, autoreset_mode="Sometimes")


@pytest.mark.parametrize("seed", [1.5, "3", [1, 2, 3], [1, "2"]])
def test_a_seed_of_another_form_is_refused_and_changes_nothing(seed: Any):
    env, other = (GraspVectorEnv(2, SOURCE, SETTINGS[:3], threads=1) for _ in range(2))
    env.reset(seed=0)
    other.reset(seed=0)
    with pytest.raises((TypeError, ValueError, gymnasium.error.Error)):
        env.reset(seed=seed)
    assert_same(env.reset(), other.reset())


def test_a_copy_of_a_vector_environment_continues_its_episodes(copied: Callable[[Any], Any]):
    env = gymnasium.make_vec(ID, num_envs=2, reaches=SOURCE)
    env.reset(seed=0)
    for _ in range(10):
        env.step(np.full((2, 1), 0.3))
    assert assert_same_steps(copied(env), env, 160) >= 2
    fresh = copied(GraspVectorEnv(2, SOURCE))
    with pytest.raises(ResetNeeded):
        fresh.step(np.zeros((2, 1)))


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_a_divergence_in_a_vector_agrees_with_single_environments(mode: AutoresetMode):
    vector = GraspVectorEnv(2, TornSource(), autoreset_mode=mode)
    singles = SyncVectorEnv([lambda: GraspEnv(TornSource())] * 2, autoreset_mode=mode)
    for env in (vector, singles):
        env.reset(seed=2)
    mask = np.array([False, True])
    one, other = (env.reset(options={"setting": TORN, "reset_mask": mask.copy()}) for env in (vector, singles))
    assert_same(one, other)
    failed = False
    for _ in range(TORN_POSE + 2):
        one, other = vector.step(np.zeros((2, 1))), singles.step(np.zeros((2, 1)))
        assert_same(one, other)
        info = one[-1].get("final_info", one[-1])
        failed |= info["failure"][1] == "the simulation diverged"
    assert failed
