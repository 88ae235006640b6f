"""Equal settings and actions give bit-equal episodes in every slot of every engine."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from dextron_bench.reaches.reach import PALM_AHEAD
from dextron_bench.world import model, task
from dextron_bench.world.engine import STATE_BOUND, Engine
from tests.helpers.short_reaches import SETTINGS, SOURCE, PlayedEpisode, actions, played


def play(engine: Engine, queue: list[int], slots: np.ndarray) -> dict[int, PlayedEpisode]:
    """Plays the settings of a queue in some slots of an engine. Each free slot takes the next setting."""
    queue, episodes = list(queue), {}
    playing: dict[int, int] = {}  # Setting by slot.
    states: dict[int, list[np.ndarray]] = {}
    rewards: dict[int, list[float]] = {}
    while queue or playing:
        free = [slot for slot in slots.tolist() if slot not in playing][: len(queue)]
        if free:
            playing |= {slot: queue.pop(0) for slot in free}
            first = engine.begin(np.array(free), [SOURCE.path(SETTINGS[playing[slot]]) for slot in free])
            states |= {slot: [row] for slot, row in zip(free, first, strict=True)}
            rewards |= {slot: [] for slot in free}
        live = np.array(list(playing))
        step = engine.step(live, np.array([actions(playing[slot])[len(rewards[slot])] for slot in playing]))
        for i, slot in enumerate(live.tolist()):
            states[slot].append(step.states[i])
            rewards[slot].append(step.rewards[i])
            if step.ended[i]:
                ends = bool(step.terminated[i]), bool(step.truncated[i])
                episodes[playing.pop(slot)] = PlayedEpisode(np.array(states[slot]), np.array(rewards[slot]), *ends)
    return episodes


def assert_bit_equal(one: PlayedEpisode, other: PlayedEpisode) -> None:
    """Asserts that two episodes agree in every bit."""
    assert one.states.tobytes() == other.states.tobytes()
    assert one.rewards.tobytes() == other.rewards.tobytes()
    assert (one.terminated, one.truncated) == (other.terminated, other.truncated)


def test_the_compared_episodes_lift_drop_and_knock_over_the_bottle():
    ends = [(played(k).rewards.sum(), played(k).terminated) for k in range(len(SETTINGS))]
    assert task.SUCCESS in [score for score, _ in ends]
    assert {terminated for _, terminated in ends} == {True, False}
    assert any(0 < score < task.SUCCESS for score, _ in ends)


@pytest.mark.parametrize(
    ("slots", "used", "threads"),
    [(1, [0], 1), (1, [0], 2), (7, [6, 0, 3], 1), (7, [2, 5], 2), (256, [255, 7, 128, 64, 13], 2)],
)
def test_slot_thread_count_and_order_change_no_bit(slots: int, used: list[int], threads: int):
    order = [3, 2, 0, 4, 1]
    episodes = play(Engine(slots, threads), order, np.array(used))
    assert sorted(episodes) == sorted(order)
    for k in order:
        assert_bit_equal(episodes[k], played(k))


def test_a_new_episode_does_not_depend_on_earlier_ones_in_its_slot():
    engine, slot = Engine(1, threads=1), np.array([0])
    for before in (0, 2):
        engine.begin(slot, [SOURCE.path(SETTINGS[before])])
        for action in actions(before)[:70]:
            engine.step(slot, action[None])
        assert_bit_equal(play(engine, [3], slot)[3], played(3))


def test_a_fork_does_not_change_its_original():
    engine, original, fork = Engine(3, threads=2), np.array([1]), np.array([2])
    engine.begin(fork, [SOURCE.path(SETTINGS[4])])
    engine.begin(original, [SOURCE.path(SETTINGS[3])])
    for action in actions(3)[:65]:
        engine.step(original, action[None])
    engine.fork(original, fork)
    for action, state, reward in zip(actions(3)[65:], played(3).states[66:], played(3).rewards[65:], strict=False):
        engine.step(fork, np.array([[-1.0]]))
        step = engine.step(original, action[None])
        assert step.states[0].tobytes() == state.tobytes()
        assert step.rewards[0] == reward
        engine.fork(original, fork)


def test_a_fork_during_contact_continues_like_its_original():
    engine, both = Engine(2, threads=2), np.array([0, 1])
    engine.begin(both[:1], [SOURCE.path(SETTINGS[3])])
    for action in actions(3)[:90]:
        engine.step(both[:1], action[None])
    engine.fork(both[:1], both[1:])
    ended = np.zeros(2, bool)
    for action, state in zip(actions(3)[90:], played(3).states[91:], strict=False):
        step = engine.step(both, np.stack([action, action]))
        assert step.states[0].tobytes() == state.tobytes() == step.states[1].tobytes()
        ended = step.ended
    assert ended.all()


def test_an_episode_begins_at_rest_with_the_hand_half_closed_at_the_carrier():
    path = SOURCE.path(SETTINGS[0])
    state = Engine(2, threads=1).begin(np.array([1]), [path])[0]
    np.testing.assert_array_equal(state[model.PALM_POSITION], path.positions[0] + PALM_AHEAD)
    np.testing.assert_array_equal(state[model.PALM_QUATERNION], path.quaternions[0])
    np.testing.assert_array_equal(state[model.BOTTLE_POSITION], [0.0, 0.0, 0.125])
    np.testing.assert_array_equal(state[25:], 0.0)
    assert task.closure(state[None])[0] == 0.5


def test_states_are_copies():
    engine, slot = Engine(1, threads=1), np.array([0])
    first = engine.begin(slot, [SOURCE.path(SETTINGS[0])])
    kept = first.copy()
    step = engine.step(slot, np.array([[1.0]]))
    np.testing.assert_array_equal(first, kept)
    step.states[:] = 7.0
    assert engine.states(slot)[0, 2] != 7.0


@pytest.mark.parametrize("value", [1e11, -1e11, np.nan, np.inf])
@pytest.mark.parametrize("entry", [2, 8, 20, 40], ids=["bottle's height", "palm", "finger", "finger's velocity"])
def test_a_simulation_that_diverges_ends_its_episode_and_no_other(entry: int, value: float):
    """MuJoCo resets such a simulation by itself, so that a state that looks sound would go on."""
    engine, slots = Engine(3, threads=2), np.array([2, 0, 1])
    engine.begin(slots, [SOURCE.path(SETTINGS[k]) for k in (0, 1, 3)])
    for t in range(20):
        step = engine.step(slots, np.array([actions(k)[t] for k in (0, 1, 3)]))
        assert not step.diverged.any()
    state_array(engine)[0, entry] = value
    step = engine.step(slots, np.array([actions(k)[20] for k in (0, 1, 3)]))
    assert step.diverged.tolist() == [False, True, False]
    assert (step.ended.tolist(), step.terminated.tolist()) == ([False, True, False], [False, True, False])
    assert step.rewards.tolist() == [0.0, 0.0, 0.0]
    assert np.isfinite(step.states).all()
    assert step.states[0].tobytes() == played(0).states[21].tobytes()
    assert step.states[2].tobytes() == played(3).states[21].tobytes()
    assert_bit_equal(play(engine, [3], np.array([0]))[3], played(3))  # Its slot plays the next episode as ever.


def state_array(engine: Engine) -> np.ndarray:
    """The positions and velocities (slots, 48) of an engine, which a test can overwrite."""
    return engine._batch.state[:, 1 : 1 + model.STATE]  # After the time.


def test_a_number_beyond_the_bound_after_the_last_physics_step_is_a_divergence():
    engine, slot = Engine(1, threads=1), np.array([0])
    engine.begin(slot, [SOURCE.path(SETTINGS[0])])
    state_array(engine)[0, 25 + 2] = 0.9999 * STATE_BOUND  # [m/s] of the bottle: 1e10 m in 50 control steps.
    steps = [engine.step(slot, np.zeros((1, 1))) for _ in range(52)]
    assert not any(step.diverged[0] for step in steps[:45])
    first = next(step for step in steps if step.diverged[0])
    assert first.rewards[0] == 0.0
    assert all(np.abs(step.states).max() <= STATE_BOUND for step in steps)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda engine: pickle.loads(pickle.dumps(engine))])
def test_a_copy_continues_every_episode_like_its_original(copied: Callable[[Engine], Engine]):
    engine, slots = Engine(2, threads=1), np.array([0, 1])
    engine.begin(slots, [SOURCE.path(SETTINGS[3]), SOURCE.path(SETTINGS[4])])
    for t in range(80):
        engine.step(slots, np.stack([actions(3)[t], actions(4)[t]]))
    other = copied(engine)
    for t in range(80, 110):
        commands = np.stack([actions(3)[t], actions(4)[t]])
        step = engine.step(slots, commands)
        again = other.step(slots, commands)
        assert step.states.tobytes() == again.states.tobytes()
        assert step.rewards.tolist() == again.rewards.tolist()
    assert engine.states(slots[:1])[0].tobytes() == played(3).states[110].tobytes()
