"""From a recorded reach to an episode's path: cleaning, interpolation, scaling and centring."""

from __future__ import annotations

from pathlib import Path as File

import numpy as np
import pytest

from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import (
    PALM_AHEAD,
    PALM_CENTRE,
    Curve,
    Reach,
    ReachError,
    clean,
    palm_centre,
    path,
    scaled_duration,
)

UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])


def about_z(angles: np.ndarray) -> np.ndarray:
    """Rotations (n, 4) about z by angles [rad] (n,)."""
    zero = np.zeros_like(angles)
    return np.stack([np.cos(angles / 2), zero, zero, np.sin(angles / 2)], axis=-1)


def turning(rate: float = 0.7) -> Reach:
    """One second along x at 0.4 m/s and up at 0.1 m/s, turning about z at `rate` [rad/s]; reached after 0.6 s."""
    times = np.arange(101) * 0.01
    positions = np.stack([0.4 * times - 0.4, np.full(101, -0.2), 0.1 + 0.1 * times], axis=1)
    return Reach("turning", times, positions, about_z(rate * times), 0.6, "made-up", 0, 0)


def steady() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, positions and quaternions of five sound samples, the clock at 7 s."""
    times = 7.0 + np.arange(5) * 0.01
    return times, np.outer(np.arange(5), [0.01, 0.0, 0.0]), about_z(np.arange(5) * 0.1)


def test_sound_samples_are_kept_and_their_clock_starts_at_zero():
    times, positions, quaternions = steady()
    found = clean(times, positions, quaternions)
    np.testing.assert_allclose(found[0], [0.0, 0.01, 0.02, 0.03, 0.04], atol=1e-12)
    np.testing.assert_array_equal(found[1], positions)
    np.testing.assert_allclose(found[2], quaternions, atol=1e-15)


def test_a_pose_sent_twice_counts_once():
    times, positions, quaternions = steady()
    positions[3], quaternions[3] = positions[2], quaternions[2]
    found = clean(times, positions, quaternions)
    np.testing.assert_allclose(found[0], [0.0, 0.01, 0.02, 0.04], atol=1e-12)


def test_of_samples_at_one_time_the_first_counts():
    times, positions, quaternions = steady()
    times[2] = times[1] + 0.001
    found = clean(times, positions, quaternions)
    np.testing.assert_array_equal(found[1][:, 0], [0.0, 0.01, 0.03, 0.04])


def test_flipped_signs_and_lengths_of_quaternions_are_mended():
    times, positions, quaternions = steady()
    found = clean(times, positions, quaternions * np.array([1.0, -1.0, 1.1, -0.9, 1.0])[:, None])
    np.testing.assert_allclose(found[2], quaternions, atol=1e-15)


def test_a_line_at_constant_speed_is_followed_exactly():
    reach, at = turning(), np.linspace(0.0, 1.0, 777)
    positions, quaternions = reach.curve(at)
    np.testing.assert_allclose(positions[:, 0], 0.4 * at - 0.4, atol=1e-13)
    np.testing.assert_allclose(positions[:, 2], 0.1 + 0.1 * at, atol=1e-13)
    np.testing.assert_allclose(quaternions, about_z(0.7 * at), atol=1e-13)


def test_a_circle_at_recording_rate_is_followed_within_a_micrometre():
    times = np.arange(101) * 0.01  # One turn of 0.3 m radius.
    angle = 2 * np.pi * times
    positions = 0.3 * np.stack([np.cos(angle), np.sin(angle), np.zeros(101)], axis=1)
    at = np.linspace(0.0, 1.0, 2001)
    found, _ = Curve.through(times, positions, np.tile(UNTURNED, (101, 1)))(at)
    exact = 0.3 * np.stack([np.cos(2 * np.pi * at), np.sin(2 * np.pi * at), np.zeros(2001)], axis=1)
    assert np.abs(found - exact).max() < 1e-6
    np.testing.assert_allclose(found[::20], positions, atol=1e-12)


def test_the_palm_centre_turns_with_its_carrier():
    quarter = about_z(np.array([0.0, np.pi / 2]))
    found = palm_centre(np.tile([1.0, 2.0, 3.0], (2, 1)), quarter)
    np.testing.assert_allclose(found, [[1.0, 2.105, 3.03], [0.895, 2.0, 3.03]])


@pytest.mark.parametrize(("recorded", "noise", "new"), [(1.0, 0.0, 3.0), (1.0, -1.0, 2.2), (2.0, 0.5, 5.9)])
def test_durations_scale_as_in_the_papers_table(recorded: float, noise: float, new: float):
    assert scaled_duration(recorded, noise) == pytest.approx(new)


@pytest.mark.parametrize(("noise", "poses"), [(0.0, 151), (-1.0, 111), (0.01, 151), (0.025, 152)])
def test_a_path_has_a_pose_every_control_step_of_its_duration(noise: float, poses: int):
    assert len(path(turning(), 0.0, 0.0, noise)) == poses


def test_a_path_slows_the_reach_down_and_keeps_its_shape():
    found = path(turning(rate=0.0), 0.0, 0.0, 0.0)  # 3 s, where the recording had 1.
    np.testing.assert_allclose(np.diff(found.positions[:, 0]), 0.4 / 3 * 0.02, atol=2e-9)
    np.testing.assert_allclose(found.positions[[0, -1], 2], [0.1, 0.2], atol=1e-9)
    np.testing.assert_allclose(found.positions[:, 1], found.positions[0, 1], atol=1e-9)


def test_the_hand_turns_at_a_third_of_its_pace():
    found = path(turning(), 0.0, 0.0, 0.0)
    np.testing.assert_allclose(found.quaternions, about_z(0.7 / 3 * 0.02 * np.arange(151)), atol=1e-9)


def test_the_palm_centre_is_at_the_offset_just_after_reached():
    found = path(turning(rate=0.0), 0.03, -0.05, 0.0)
    settled = slice(90, 100)  # 1.8 s up to 2.0 s.
    centre = palm_centre(found.positions, found.quaternions)[settled].mean(axis=0)
    np.testing.assert_allclose(centre[:2], [0.03, -0.05], atol=1e-8)
    height = 0.1 + 0.1 * np.mean(np.arange(90, 100)) * 0.02 / 3 + 0.03
    assert centre[2] == pytest.approx(height)  # Heights are left as recorded.


def test_centring_takes_the_palm_centre_of_the_mean_pose_of_a_turning_hand():
    found = path(turning(), 0.03, -0.05, 0.0)
    pose = found.positions[90:100].mean(axis=0), rotation.mean(found.quaternions[90:100])
    np.testing.assert_allclose(palm_centre(*pose)[:2], [0.03, -0.05], atol=1e-8)


def test_the_offset_shifts_a_whole_path():
    here, there = path(turning(), 0.0, 0.0, 0.3), path(turning(), 0.06, -0.02, 0.3)
    np.testing.assert_allclose(there.positions - here.positions, np.tile([0.06, -0.02, 0.0], (len(here), 1)), atol=2e-9)
    np.testing.assert_array_equal(there.quaternions, here.quaternions)


def test_paths_are_whole_nanometres_and_equal_each_time():
    reach = turning()
    one, two = path(reach, 0.01, 0.02, 0.4), path(reach, 0.01, 0.02, 0.4)
    assert one.positions.tobytes() == two.positions.tobytes()
    assert one.quaternions.tobytes() == two.quaternions.tobytes()
    np.testing.assert_array_equal(np.round(one.positions, 9), one.positions)


def test_noise_may_not_make_a_reach_faster_than_it_was():
    assert len(path(turning(), 0.0, 0.0, -2.5)) == 51
    with pytest.raises(ReachError, match=r"reach turning last 0.92 s, less than the recorded 1.00 s"):
        path(turning(), 0.0, 0.0, -2.6)


PEAK = 6.0  # [m/s] a hand that reaches for a thing is slower; one that strikes is not.
JUMPS = {"08_fr_16", "08_nr_04"}  # Recordings in which the tracker lost the hand and found it 0.1 m further on.


@pytest.mark.slow
def test_every_real_reach_becomes_a_sound_path_at_human_speed(release: File):
    from dextron_bench.reaches.recorded.release import Manifest, read

    reaches = read(release, Manifest.load())
    assert len(reaches) == 575
    fast = set()
    for reach in reaches:
        at = np.arange(0.0, reach.duration, 0.002)
        positions, quaternions = reach.curve(at)
        speed = np.linalg.norm(np.diff(palm_centre(positions, quaternions), axis=0), axis=1) / 0.002
        if speed.max() > PEAK:
            fast.add(reach.name)
        found = path(reach, 0.02, -0.03, 0.0)
        assert np.isfinite(found.positions).all()
        np.testing.assert_allclose(np.linalg.norm(found.quaternions, axis=1), 1.0, atol=1e-8)
        assert (np.sum(found.quaternions[1:] * found.quaternions[:-1], axis=1) > 0.9).all()
        assert 0.0 < reach.reached < reach.duration
    assert fast == JUMPS


def test_the_palm_sits_where_the_model_welds_it():
    from dextron_bench.world import model

    weld = model.load().equality("carried").data  # Anchor (3), then the palm's pose in the carrier's frame.
    np.testing.assert_allclose(weld[3:10], [*PALM_AHEAD, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(PALM_CENTRE, model.load().site("palm_centre").pos)
