"""The task's measurements, commands, reward and endings, with numbers done by hand."""

from __future__ import annotations

import numpy as np
import pytest

from dextron_bench.reaches.reach import Path
from dextron_bench.world import model, task
from dextron_bench.world.engine import Engine

HALF = np.sqrt(0.5)


def states(n: int = 1) -> np.ndarray:
    """States (n, 48) at the start of an episode: the palm's origin at (0, -0.335, 0.2), unturned."""
    return np.tile(np.concatenate([model.half_closed(), np.zeros(23)]), (n, 1))


def seen(bottle: list[float], hand: list[float] | None = None) -> np.ndarray:
    """States of one episode over time, as (T, 1, 48), from the heights [m] of bottle and hand."""
    rows = states(len(bottle))
    rows[:, 2] = bottle
    rows[:, 9] = hand if hand is not None else 0.2
    return rows[:, None]


def course(heights: np.ndarray, poses: int = 10_000) -> tuple[list[float], int, bool, bool]:
    """Rewards up to the end, the step at which it came (0: never), and whether terminated or truncated."""
    progress, ids = task.Progress.empty(1), np.array([0])
    progress.begin(ids, states(), np.array([poses]))
    rewards = []
    for k, state in enumerate(heights, start=1):
        reward, terminated, truncated = progress.advance(ids, state)
        rewards.append(float(reward[0]))
        if terminated[0] or truncated[0]:
            return rewards, k, bool(terminated[0]), bool(truncated[0])
    return rewards, 0, False, False


def test_every_digit_starts_half_closed_and_the_thumb_opposed():
    angles = {
        "thumb_base": 1.05,
        "thumb_proximal": -0.285,
        "thumb_distal": -0.2565,  # Coupled 0.9 to 1.
        **{f"{finger}_{part}": 0.785 for finger in model.DIGITS[1:] for part in ("proximal", "distal")},
    }
    qpos = model.half_closed()
    found = {name: float(qpos[model.load().joint(name).qposadr[0]]) for name in angles}
    assert found == pytest.approx(angles)


def test_palm_centre_turns_with_the_palm():
    rows = states(2)
    rows[:, 7:10] = 1.0, 2.0, 3.0
    rows[0, 10:14] = 1.0, 0.0, 0.0, 0.0
    rows[1, 10:14] = HALF, 0.0, 0.0, HALF  # A quarter turn about z: y goes to -x.
    np.testing.assert_allclose(task.palm_centre(rows), [[1.0, 2.09, 3.03], [0.91, 2.0, 3.03]])


def test_palm_centre_is_where_the_model_has_its_site():
    np.testing.assert_array_equal(model.load().site("palm_centre").pos, task.PALM_CENTRE)


def test_distance_is_level_and_to_the_bottles_axis():
    rows = states()
    rows[0, 7:10] = 0.3, 0.31, 5.0  # Palm centre at (0.3, 0.4).
    rows[0, :3] = 0.0, 0.0, 0.125
    assert task.distance(rows)[0] == pytest.approx(0.5)
    rows[0, :3] = 0.3, 0.1, -7.0
    assert task.distance(rows)[0] == pytest.approx(0.3)


@pytest.mark.parametrize(("digit", "angle"), [("thumb", -0.57 * 0.8), ("index", 1.256), ("little", 1.256)])
def test_closure_is_that_of_the_most_closed_digit(digit: str, angle: float):
    rows = states()
    rows[0, model.load().joint(f"{digit}_proximal").qposadr[0]] = angle
    assert task.closure(rows)[0] == pytest.approx(0.8)


def test_closure_leaves_out_the_thumbs_base_and_the_distal_joints():
    rows = states()
    for name in ("thumb_base", "index_distal"):
        rows[0, model.load().joint(name).qposadr[0]] = 1.5
    assert task.closure(rows)[0] == pytest.approx(0.5)


def test_commands_hold_the_thumbs_base_and_slow_the_thumb_by_its_range():
    found = task.commands(np.array([[1.0], [-0.5], [0.0]]))
    thumb = 0.57 / 1.57
    expected = [[1.05, thumb, 1, 1, 1, 1], [1.05, -thumb / 2, -0.5, -0.5, -0.5, -0.5], [1.05, 0, 0, 0, 0, 0]]
    np.testing.assert_allclose(found, expected)


@pytest.mark.parametrize(("action", "sign"), [(1.0, 1.0), (-1.0, -1.0)])
def test_a_positive_action_closes_every_digit_and_a_negative_one_opens_it(action: float, sign: float):
    far = Path(np.tile([0.0, -0.6, 0.3], (30, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (30, 1)))
    engine, slot = Engine(1, threads=1), np.array([0])
    joints, closed = model.proximal()
    before = engine.begin(slot, [far])[0, joints] / closed
    for _ in range(20):
        engine.step(slot, np.array([[action]]))
    after = engine.states(slot)[0, joints] / closed
    assert (sign * (after - before) > 0.1).all()
    assert np.ptp(after) < 0.1  # Digits of different range close at one pace.


def test_the_countdown_begins_unpaid_and_pays_twenty_steps():
    rewards, end, terminated, truncated = course(seen([0.125] * 5 + [0.25] * 30))
    assert rewards == [0.0] * 6 + [1.0] * 20
    assert (end, terminated, truncated) == (26, False, True)
    assert sum(rewards) == task.SUCCESS


def test_only_steps_with_the_bottle_lifted_are_paid():
    rewards, end, *_ = course(seen([0.25] + [0.3, 0.2499] * 15))
    assert sum(rewards) == 10.0
    assert end == 21


def test_a_raised_hand_starts_the_countdown_too():
    below, above = np.nextafter(0.2 + 0.145, 0.0), 0.2 + 0.145
    assert course(seen([0.125] * 40, [below] * 40))[1] == 0
    rewards, end, _, truncated = course(seen([0.125] * 40, [0.2] * 3 + [above] + [0.2] * 36))
    assert (sum(rewards), end, truncated) == (0.0, 24, True)


def test_the_countdown_runs_once():
    rewards, end, *_ = course(seen([0.25] + [0.2] * 10 + [0.25] * 30))
    assert (sum(rewards), end) == (10.0, 21)


def test_a_fallen_bottle_terminates():
    assert course(seen([0.125, 0.110, 0.1099]))[1:] == (3, True, False)


def test_a_fall_at_the_last_moment_is_a_fall_and_not_a_timeout():
    rewards, *ends = course(seen([0.25] + [0.26] * 19 + [0.1]))
    assert ends == [21, True, False]
    assert sum(rewards) == 19.0


def test_the_last_pose_is_held_for_twenty_steps():
    assert course(seen([0.125] * 600), poses=101)[1:] == (120, False, True)


@pytest.mark.parametrize("poses", [482, 501, 10_000])
def test_no_episode_outlasts_ten_seconds(poses: int):
    assert course(seen([0.125] * 600), poses)[1:] == (500, False, True)


def test_episodes_do_not_mix():
    progress, ids = task.Progress.empty(3), np.array([2, 0])
    progress.begin(ids, states(2), np.array([5, 50]))
    rows = seen([0.25, 0.125])[:, 0]
    progress.advance(ids, rows)
    reward, _, _ = progress.advance(ids, rows)
    assert reward.tolist() == [1.0, 0.0]
    assert progress.left.tolist() == [-1, -1, 19]
    assert progress.step.tolist() == [2, 0, 2]
    progress.copy(np.array([2]), np.array([1]))
    assert progress.left.tolist() == [-1, 19, 19]
    assert progress.last.tolist() == [69, 24, 24]
