"""Measurements, commands, rewards and ends of the task, with numbers calculated by hand."""

from __future__ import annotations

import numpy as np
import pytest

from dextron_bench.reaches.reach import Trajectory
from dextron_bench.world import model, task
from dextron_bench.world.engine import Engine

HALF = np.sqrt(0.5)


def states(n: int = 1) -> np.ndarray:
    """States (n, 48) at the start of an episode: the palm's origin at (0, -0.335, 0.2), unturned."""
    return np.tile(np.concatenate([model.initial_qpos(), np.zeros(23)]), (n, 1))


def trajectory(bottle: list[float], hand: list[float] | None = None) -> np.ndarray:
    """States (T, 1, 48) of one episode with these heights [m] of bottle and hand."""
    rows = states(len(bottle))
    rows[:, 2] = bottle
    rows[:, 9] = hand if hand is not None else 0.2
    return rows[:, None]


def play(trajectory: np.ndarray, poses: int = 10_000) -> tuple[list[float], int, bool, bool]:
    """Rewards until the end, the step of the end (0 if there is none), and whether it terminated or truncated."""
    progress, ids = task.EpisodeState.empty(1), np.array([0])
    progress.begin(ids, states(), np.array([poses]))
    rewards = []
    for k, state in enumerate(trajectory, start=1):
        reward, terminated, truncated = progress.advance(ids, state)
        rewards.append(float(reward[0]))
        if terminated[0] or truncated[0]:
            return rewards, k, bool(terminated[0]), bool(truncated[0])
    return rewards, 0, False, False


def test_the_palm_centre_rotates_with_the_palm():
    rows = states(2)
    rows[:, 7:10] = 1.0, 2.0, 3.0
    rows[0, 10:14] = 1.0, 0.0, 0.0, 0.0
    rows[1, 10:14] = HALF, 0.0, 0.0, HALF  # A quarter turn about z: y goes to -x.
    np.testing.assert_allclose(task.palm_centre(rows), [[1.0, 2.09, 3.03], [0.91, 2.0, 3.03]])


def test_the_palm_centre_agrees_with_the_site_of_the_model():
    np.testing.assert_array_equal(model.load().site("palm_centre").pos, task.PALM_CENTRE)


def test_the_distance_is_horizontal_and_to_the_bottles_axis():
    rows = states()
    rows[0, 7:10] = 0.3, 0.31, 5.0  # Palm centre at (0.3, 0.4).
    rows[0, :3] = 0.0, 0.0, 0.125
    assert task.distance(rows)[0] == pytest.approx(0.5)
    rows[0, :3] = 0.3, 0.1, -7.0
    assert task.distance(rows)[0] == pytest.approx(0.3)


@pytest.mark.parametrize(("digit", "angle"), [("thumb", -0.57 * 0.8), ("index", 1.256), ("little", 1.256)])
def test_the_most_closed_digit_determines_the_closure(digit: str, angle: float):
    rows = states()
    rows[0, model.load().joint(f"{digit}_proximal").qposadr[0]] = angle
    assert task.closure(rows)[0] == pytest.approx(0.8)


def test_the_closure_ignores_the_thumbs_base_and_the_distal_joints():
    rows = states()
    for name in ("thumb_base", "index_distal"):
        rows[0, model.load().joint(name).qposadr[0]] = 1.5
    assert task.closure(rows)[0] == pytest.approx(0.5)


def test_commands_hold_the_thumbs_base_and_scale_the_thumbs_speed_by_its_range():
    controls = task.commands(np.array([[1.0], [-0.5], [0.0]]))
    thumb = 0.57 / 1.57
    expected = [[1.05, thumb, 1, 1, 1, 1], [1.05, -thumb / 2, -0.5, -0.5, -0.5, -0.5], [1.05, 0, 0, 0, 0, 0]]
    np.testing.assert_allclose(controls, expected)


def test_a_positive_action_closes_every_digit_and_a_negative_one_opens_it():
    """After 0.4 s, the closing digits are closed further by 0.1 than digits at rest, and the opening ones less far."""
    far = Trajectory(np.tile([0.0, -0.6, 0.3], (30, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (30, 1)))
    engine, slots = Engine(3, threads=1), np.arange(3)
    joints, closed = model.proximal()
    engine.begin(slots, [far] * 3)
    for _ in range(20):
        engine.step(slots, np.array([[1.0], [0.0], [-1.0]]))
    closing, resting, opening = engine.states(slots)[:, joints] / closed
    assert (closing[[0, 2, 3, 4]] > resting[[0, 2, 3, 4]] + 0.1).all()
    assert closing[1] > resting[1]  # The index finger meets the thumb.
    assert (opening < resting - 0.1).all()
    assert np.ptp(opening) < 0.1  # Digits with different ranges take the same time.


def test_the_first_step_of_the_countdown_earns_nothing_and_twenty_steps_earn_one():
    rewards, end, terminated, truncated = play(trajectory([0.125] * 5 + [0.25] * 30))
    assert rewards == [0.0] * 6 + [1.0] * 20
    assert (end, terminated, truncated) == (26, False, True)
    assert sum(rewards) == task.SUCCESS


def test_only_steps_with_the_bottle_lifted_earn_a_reward():
    rewards, end, *_ = play(trajectory([0.25] + [0.3, 0.2499] * 15))
    assert sum(rewards) == 10.0
    assert end == 21


def test_a_raised_hand_starts_the_countdown_too():
    below, above = np.nextafter(0.2 + 0.145, 0.0), 0.2 + 0.145
    assert play(trajectory([0.125] * 40, [below] * 40))[1] == 0
    rewards, end, _, truncated = play(trajectory([0.125] * 40, [0.2] * 3 + [above] + [0.2] * 36))
    assert (sum(rewards), end, truncated) == (0.0, 24, True)


def test_the_countdown_runs_only_once():
    rewards, end, *_ = play(trajectory([0.25] + [0.2] * 10 + [0.25] * 30))
    assert (sum(rewards), end) == (10.0, 21)


def test_a_fallen_bottle_terminates():
    assert play(trajectory([0.125, 0.110, 0.1099]))[1:] == (3, True, False)


def test_a_fall_at_the_last_step_terminates_and_does_not_truncate():
    rewards, *end = play(trajectory([0.25] + [0.26] * 19 + [0.1]))
    assert end == [21, True, False]
    assert sum(rewards) == 19.0


def test_the_last_pose_is_held_for_twenty_steps():
    assert play(trajectory([0.125] * 600), poses=101)[1:] == (120, False, True)


@pytest.mark.slow
@pytest.mark.parametrize("poses", [482, 501, 10_000])
def test_no_episode_is_longer_than_ten_seconds(poses: int):
    assert play(trajectory([0.125] * 600), poses)[1:] == (500, False, True)


@pytest.mark.slow
def test_the_progress_of_episodes_is_independent():
    progress, ids = task.EpisodeState.empty(3), np.array([2, 0])
    progress.begin(ids, states(2), np.array([5, 50]))
    rows = trajectory([0.25, 0.125])[:, 0]
    progress.advance(ids, rows)
    reward, _, _ = progress.advance(ids, rows)
    assert reward.tolist() == [1.0, 0.0]
    assert progress.left.tolist() == [-1, -1, 19]
    assert progress.step.tolist() == [2, 0, 2]
    progress.copy(np.array([2]), np.array([1]))
    assert progress.left.tolist() == [-1, 19, 19]
    assert progress.last.tolist() == [69, 24, 24]
