"""The model against the numbers of the authors' release: start, couplings, actuators, and pairs that never touch."""

from __future__ import annotations

import json

import mujoco
import numpy as np
import pytest

from dextron_bench.world import model
from tools import hand_constants

FINGERS = model.DIGITS[1:]
CARRIED = "palm", "thumb_proximal"  # Overlap, and do not collide in the release.
MARGIN = 0.0025  # [m] of a pair: MuJoCo adds the margins of 0.00125 of both shapes.


def angle(data: mujoco.MjData, joint: str) -> float:
    return float(data.qpos[model.load().joint(joint).qposadr[0]])


def at_start() -> mujoco.MjData:
    data = mujoco.MjData(model.load())
    data.qpos[:] = model.initial_qpos()
    return data


def test_only_the_proximal_joints_start_half_closed() -> None:
    """Half of 1.57 is 0.785, and half of -0.57 is -0.285."""
    expected = {f"{digit}_{part}": 0.0 for digit in model.DIGITS for part in ("proximal", "distal")}
    expected |= {f"{finger}_proximal": 0.785 for finger in FINGERS} | {"thumb_proximal": -0.285, "thumb_base": 0.0}
    data = at_start()
    assert {joint: angle(data, joint) for joint in expected} == expected


def test_the_couplings_open_the_digits_and_the_base_of_the_thumb_travels() -> None:
    """Measured on the authors' model: 0.34 of closure after 0.1 s, 0.43 for the thumb, whose base ends at 1.05."""
    data = at_start()
    data.mocap_pos[0] = data.qpos[model.PALM_POSITION] - [0.0, 0.015, 0.0]
    data.ctrl[0] = 1.05
    mujoco.mj_step(model.load(), data, nstep=50)
    joints, closed = model.proximal()
    np.testing.assert_allclose(data.qpos[joints] / closed, [0.43, 0.34, 0.34, 0.34, 0.34], atol=0.006)
    mujoco.mj_step(model.load(), data, nstep=450)
    assert angle(data, "thumb_base") == pytest.approx(1.05, abs=0.002)
    for finger in FINGERS:
        assert angle(data, f"{finger}_distal") == pytest.approx(angle(data, f"{finger}_proximal"), abs=0.005)
    assert 0.9 * angle(data, "thumb_distal") == pytest.approx(angle(data, "thumb_proximal"), abs=0.005)


def test_actuators_have_the_gains_and_limits_of_the_release() -> None:
    compiled = model.load()
    names = ["thumb_base", "thumb", *FINGERS]
    assert [compiled.actuator(i).name for i in range(compiled.nu)] == names
    np.testing.assert_array_equal(compiled.actuator_gainprm[:, 0], [1, 50, 50, 50, 50, 50])
    np.testing.assert_array_equal(compiled.actuator_biasprm[0, :3], [0, -1, 0])
    np.testing.assert_array_equal(compiled.actuator_biasprm[1:, 2], -50)
    np.testing.assert_array_equal(compiled.actuator_forcerange[:, 1], [1, 2, 1, 1, 1, 1])
    np.testing.assert_array_equal(compiled.actuator_gear[:, 0], [1, -1, 1, 1, 1, 1])


def test_pairs_that_are_excluded_can_never_touch() -> None:
    """Distances stay above the pair's margin for joint angles over their whole range, coupled or not."""
    compiled, data, rng = model.load(), mujoco.MjData(model.load()), np.random.default_rng(0)
    pairs = [divmod(int(signature), 1 << 16) for signature in compiled.exclude_signature]
    names = [(compiled.body(a).name, compiled.body(b).name) for a, b in pairs]
    assert CARRIED in [tuple(sorted(pair)) for pair in names]
    geoms = [compiled.body(body).geomadr[0] for pair in names if tuple(sorted(pair)) != CARRIED for body in pair]
    fingers = [joint for joint in range(compiled.njnt) if compiled.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE]
    low, high = compiled.jnt_range[fingers].T
    closest = np.inf
    for _ in range(500):
        share = np.where(rng.random(len(fingers)) < 0.5, rng.integers(0, 2, len(fingers)), rng.random(len(fingers)))
        data.qpos[compiled.jnt_qposadr[fingers]] = low + share * (high - low)
        mujoco.mj_kinematics(compiled, data)
        for first, second in zip(geoms[::2], geoms[1::2], strict=True):
            closest = min(closest, mujoco.mj_geomDistance(compiled, data, first, second, 0.05, None))
    assert closest > MARGIN


def test_the_constants_beside_the_model_are_those_of_the_model():
    """An isolated agent has no simulator: what it computes from states must be what the world computes."""
    assert json.loads(hand_constants.FILE.read_text()) == hand_constants.constants(), "python -m tools.hand_constants"
