"""The path of an episode from a recorded reach: cleaning, interpolation, scaling and centring."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dextron_bench.errors import BadInput
from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import PALM_AHEAD, PALM_CENTRE, Curve, Reach, clean, palm_centre, path, scaled_duration
from dextron_bench.reaches.recorded.cache import load_reaches
from dextron_bench.reaches.setting import Source

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def about_z(angles: np.ndarray) -> np.ndarray:
    """Rotations (n, 4) about z by angles [rad] (n,)."""
    zero = np.zeros_like(angles)
    return np.stack([np.cos(angles / 2), zero, zero, np.sin(angles / 2)], axis=-1)


def turning_reach(rate: float = 0.7) -> Reach:
    """One second at 0.4 m/s along x and 0.1 m/s up, with a rotation about z at `rate` [rad/s]; arrives at 0.6 s."""
    times = np.arange(101) * 0.01
    positions = np.stack([0.4 * times - 0.4, np.full(101, -0.2), 0.1 + 0.1 * times], axis=1)
    return Reach("turning", times, positions, about_z(rate * times), 0.6, "made-up", 0, 0)


def five_samples() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, positions and quaternions of five valid samples, the first at 7 s."""
    times = 7.0 + np.arange(5) * 0.01
    return times, np.outer(np.arange(5), [0.01, 0.0, 0.0]), about_z(np.arange(5) * 0.1)


def test_valid_samples_are_kept_and_their_clock_starts_at_zero():
    times, positions, quaternions = five_samples()
    cleaned = clean(times, positions, quaternions)
    np.testing.assert_allclose(cleaned[0], [0.0, 0.01, 0.02, 0.03, 0.04], atol=1e-12)
    np.testing.assert_array_equal(cleaned[1], positions)
    np.testing.assert_allclose(cleaned[2], quaternions, atol=1e-15)


def test_a_pose_that_is_sent_twice_counts_once():
    times, positions, quaternions = five_samples()
    positions[3], quaternions[3] = positions[2], quaternions[2]
    cleaned = clean(times, positions, quaternions)
    np.testing.assert_allclose(cleaned[0], [0.0, 0.01, 0.02, 0.04], atol=1e-12)


def test_the_first_of_two_samples_at_one_time_counts():
    times, positions, quaternions = five_samples()
    times[2] = times[1] + 0.001
    cleaned = clean(times, positions, quaternions)
    np.testing.assert_array_equal(cleaned[1][:, 0], [0.0, 0.01, 0.03, 0.04])


def test_signs_and_lengths_of_quaternions_are_corrected():
    times, positions, quaternions = five_samples()
    cleaned = clean(times, positions, quaternions * np.array([1.0, -1.0, 1.1, -0.9, 1.0])[:, None])
    np.testing.assert_allclose(cleaned[2], quaternions, atol=1e-15)


def test_a_line_at_constant_speed_is_followed_exactly():
    reach, times = turning_reach(), np.linspace(0.0, 1.0, 777)
    positions, quaternions = reach.curve(times)
    np.testing.assert_allclose(positions[:, 0], 0.4 * times - 0.4, atol=1e-13)
    np.testing.assert_allclose(positions[:, 2], 0.1 + 0.1 * times, atol=1e-13)
    np.testing.assert_allclose(quaternions, about_z(0.7 * times), atol=1e-13)


def test_a_circle_at_the_recording_rate_is_followed_within_a_micrometre():
    times = np.arange(101) * 0.01  # One revolution with a radius of 0.3 m.
    angle = 2 * np.pi * times
    positions = 0.3 * np.stack([np.cos(angle), np.sin(angle), np.zeros(101)], axis=1)
    queries = np.linspace(0.0, 1.0, 2001)
    interpolated, _ = Curve.through(times, positions, np.tile(IDENTITY, (101, 1)))(queries)
    exact = 0.3 * np.stack([np.cos(2 * np.pi * queries), np.sin(2 * np.pi * queries), np.zeros(2001)], axis=1)
    assert np.abs(interpolated - exact).max() < 1e-6
    np.testing.assert_allclose(interpolated[::20], positions, atol=1e-12)


def test_the_palm_centre_rotates_with_its_carrier():
    orientations = about_z(np.array([0.0, np.pi / 2]))
    centres = palm_centre(np.tile([1.0, 2.0, 3.0], (2, 1)), orientations)
    np.testing.assert_allclose(centres, [[1.0, 2.105, 3.03], [0.895, 2.0, 3.03]])


@pytest.mark.parametrize(("recorded", "noise", "scaled"), [(1.0, 0.0, 3.0), (1.0, -1.0, 2.2), (2.0, 0.5, 5.9)])
def test_durations_scale_as_in_the_table_of_the_paper(recorded: float, noise: float, scaled: float):
    assert scaled_duration(recorded, noise) == pytest.approx(scaled)


@pytest.mark.parametrize(("noise", "poses"), [(0.0, 151), (-1.0, 111), (0.01, 151), (0.025, 152)])
def test_a_path_has_one_pose_for_each_control_step_of_its_duration(noise: float, poses: int):
    assert len(path(turning_reach(), 0.0, 0.0, noise)) == poses


def test_a_path_is_slower_than_the_reach_and_keeps_its_shape():
    followed = path(turning_reach(rate=0.0), 0.0, 0.0, 0.0)  # 3 s; the recording has 1 s.
    np.testing.assert_allclose(np.diff(followed.positions[:, 0]), 0.4 / 3 * 0.02, atol=2e-9)
    np.testing.assert_allclose(followed.positions[[0, -1], 2], [0.1, 0.2], atol=1e-9)
    np.testing.assert_allclose(followed.positions[:, 1], followed.positions[0, 1], atol=1e-9)


def test_the_hand_rotates_at_a_third_of_its_recorded_speed():
    followed = path(turning_reach(), 0.0, 0.0, 0.0)
    np.testing.assert_allclose(followed.quaternions, about_z(0.7 / 3 * 0.02 * np.arange(151)), atol=1e-9)


def test_the_palm_centre_is_at_the_offset_just_after_reached():
    followed = path(turning_reach(rate=0.0), 0.03, -0.05, 0.0)
    settled = slice(90, 100)  # From 1.8 s to 2.0 s.
    centre = palm_centre(followed.positions, followed.quaternions)[settled].mean(axis=0)
    np.testing.assert_allclose(centre[:2], [0.03, -0.05], atol=1e-8)
    height = 0.1 + 0.1 * np.mean(np.arange(90, 100)) * 0.02 / 3 + 0.03
    assert centre[2] == pytest.approx(height)  # Heights stay as recorded.


def test_a_rotating_hand_is_centred_by_the_palm_centre_of_its_mean_pose():
    followed = path(turning_reach(), 0.03, -0.05, 0.0)
    pose = followed.positions[90:100].mean(axis=0), rotation.mean(followed.quaternions[90:100])
    np.testing.assert_allclose(palm_centre(*pose)[:2], [0.03, -0.05], atol=1e-8)


def test_the_offset_shifts_a_whole_path():
    centred, shifted = path(turning_reach(), 0.0, 0.0, 0.3), path(turning_reach(), 0.06, -0.02, 0.3)
    shifts = shifted.positions - centred.positions
    np.testing.assert_allclose(shifts, np.tile([0.06, -0.02, 0.0], (len(centred), 1)), atol=2e-9)
    np.testing.assert_array_equal(shifted.quaternions, centred.quaternions)


def test_paths_are_rounded_to_nanometres_and_reproducible():
    reach = turning_reach()
    first, second = path(reach, 0.01, 0.02, 0.4), path(reach, 0.01, 0.02, 0.4)
    assert first.positions.tobytes() == second.positions.tobytes()
    assert first.quaternions.tobytes() == second.quaternions.tobytes()
    np.testing.assert_array_equal(np.round(first.positions, 9), first.positions)


def test_noise_that_makes_a_reach_faster_than_the_recording_is_refused():
    assert len(path(turning_reach(), 0.0, 0.0, -2.5)) == 51
    with pytest.raises(BadInput, match=r"reach turning last 0.92 s, less than the recorded 1.00 s"):
        path(turning_reach(), 0.0, 0.0, -2.6)


PEAK = 6.0  # [m/s] above the speed of any hand that reaches for an object.
JUMPS = {"08_fr_16", "08_nr_04"}  # Recordings in which the tracker lost the hand for a moment, so it jumps by 0.1 m.


@pytest.mark.slow
def test_every_recorded_reach_gives_a_valid_path_at_human_speed(opened: Callable[[str], Source]):
    opened("real")
    reaches = load_reaches()
    assert len(reaches) == 575
    fast = set()
    for reach in reaches:
        positions, quaternions = reach.curve(np.arange(0.0, reach.duration, 0.002))
        speed = np.linalg.norm(np.diff(palm_centre(positions, quaternions), axis=0), axis=1) / 0.002
        if speed.max() > PEAK:
            fast.add(reach.name)
        followed = path(reach, 0.02, -0.03, 0.0)
        assert np.isfinite(followed.positions).all()
        np.testing.assert_allclose(np.linalg.norm(followed.quaternions, axis=1), 1.0, atol=1e-8)
        assert (np.sum(followed.quaternions[1:] * followed.quaternions[:-1], axis=1) > 0.9).all()
        assert 0.0 < reach.reached < reach.duration
    assert fast == JUMPS


def test_the_palm_has_the_pose_of_the_weld_in_the_model():
    from dextron_bench.world import model

    weld = model.load().equality("carried").data  # Anchor (3), then the palm's pose in the carrier's frame.
    np.testing.assert_allclose(weld[3:10], [*PALM_AHEAD, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(PALM_CENTRE, model.load().site("palm_centre").pos)
