"""The MuJoCo model of hand, bottle and table. Only this module and `tools/hand_constants.py` use names of its elements.

What pure functions of states need of the model is in `hand.json`, so that they work without the simulator.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from dextron_bench.reaches.timing import CONTROL_STEP

if TYPE_CHECKING:
    from dextron_bench.world.simulator import mujoco

DIGITS = ("thumb", "index", "middle", "ring", "little")
STATE = 48  # qpos (25), then qvel (23).
THUMB_OPPOSED = 1.05  # [rad] commanded angle of the thumb's base.
REFERENCE_RANGE = 1.57  # [rad] joint range whose velocity command equals the action.

# Indices in a state. A free joint has a position (3) and a quaternion wxyz (4).
BOTTLE_POSITION = slice(0, 3)
BOTTLE_QUATERNION = slice(3, 7)
PALM_POSITION = slice(7, 10)
PALM_QUATERNION = slice(10, 14)


def mjcf() -> str:
    """The MJCF source of the model."""
    return files("dextron_bench.world").joinpath("hand.xml").read_text(encoding="utf-8")


def mjcf_hash() -> str:
    """SHA-256 of the MJCF source, hexadecimal."""
    return hashlib.sha256(mjcf().encode()).hexdigest()


@cache
def load() -> mujoco.MjModel:
    """The compiled model. All callers share it and must not change it."""
    from dextron_bench.world.simulator import mujoco

    return mujoco.MjModel.from_xml_string(mjcf())


@cache
def substeps() -> int:
    """Physics steps in one control step."""
    return round(CONTROL_STEP / load().opt.timestep)


@cache
def proximal() -> tuple[np.ndarray, np.ndarray]:
    """Indices in qpos of the five proximal joints, thumb first, and their angles [rad] when closed; each (5,)."""
    return _read_only(np.array(_constants()["proximal"], np.int32)), _read_only(np.array(_constants()["closed"]))


@cache
def command_gain() -> np.ndarray:
    """Velocity command of each digit [rad/s] for an action of 1, shape (5,), thumb first."""
    return _read_only(np.abs(proximal()[1]) / REFERENCE_RANGE)


@cache
def initial_qpos() -> np.ndarray:
    """Joint positions (25,) at the start of an episode, without the palm's pose, which the caller sets.

    Only the proximal joints are set, to half of their range; the couplings then pull each digit open by about a third.
    """
    return _read_only(np.array(_constants()["start"]))


@cache
def bottle_indices() -> tuple[int, int, int]:
    """Indices of the bottle's body and geom, and of its bounding box in `bvh_aabb`."""
    body = load().body("bottle").id
    return body, load().geom("bottle").id, int(load().body_bvhadr[body])


@cache
def state_names() -> tuple[str, ...]:
    """Names of the 48 numbers in a state: positions, then velocities.

    Positions are in [m], quaternions are wxyz, and angles are in [rad]. For free bodies, `vx` to `vz` are velocities in
    the world frame [m/s], and `wx` to `wz` are angular velocities about the axes of the body [rad/s].
    """
    return tuple(_constants()["state_names"])


@cache
def _constants() -> dict[str, Any]:
    """What `tools/hand_constants.py` took from the model."""
    return json.loads(files("dextron_bench.world").joinpath("hand.json").read_text(encoding="utf-8"))


def _read_only(array: np.ndarray) -> np.ndarray:
    """Makes the array read-only, since all callers share it, and returns it."""
    array.flags.writeable = False
    return array
