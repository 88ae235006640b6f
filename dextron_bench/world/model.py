"""The MuJoCo model of hand, bottle and table; the only home of its element names."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.resources import files

import mujoco
import numpy as np

from dextron_bench.reaches.timing import CONTROL_STEP

DIGITS = ("thumb", "index", "middle", "ring", "little")
STATE = 48  # qpos (25), then qvel (23).
THUMB_OPPOSED = 1.05  # [rad] where the thumb's base is held.
HALF_CLOSED = 0.5  # Closure of every digit at the start of an episode.
REFERENCE_RANGE = 1.57  # [rad] joint range whose velocity command equals the action.

# Where things stand in a state: free joints are position (3) and quaternion wxyz (4).
BOTTLE_POSITION = slice(0, 3)
BOTTLE_QUATERNION = slice(3, 7)
PALM_POSITION = slice(7, 10)
PALM_QUATERNION = slice(10, 14)
FREE_PLACE, FREE_SPEED = ("x", "y", "z", "qw", "qx", "qy", "qz"), ("vx", "vy", "vz", "wx", "wy", "wz")


def mjcf() -> str:
    """The model's source."""
    return files("dextron_bench.world").joinpath("hand.xml").read_text(encoding="utf-8")


def mjcf_hash() -> str:
    """SHA-256 of the model's source, hexadecimal."""
    return hashlib.sha256(mjcf().encode()).hexdigest()


@cache
def load() -> mujoco.MjModel:
    """The compiled model, shared; treat it as read-only."""
    return mujoco.MjModel.from_xml_string(mjcf())


@cache
def substeps() -> int:
    """Physics steps in one control step."""
    return round(CONTROL_STEP / load().opt.timestep)


@cache
def proximal() -> tuple[np.ndarray, np.ndarray]:
    """Indices in qpos of the five proximal joints (thumb first), and their angles [rad] when closed."""
    joints = [load().joint(f"{digit}_proximal") for digit in DIGITS]
    closed = [joint.range[np.argmax(np.abs(joint.range))] for joint in joints]
    return _frozen(np.array([joint.qposadr[0] for joint in joints])), _frozen(np.array(closed))


@cache
def command_gain() -> np.ndarray:
    """Velocity command of each digit [rad/s] for an action of 1, shape (5,), thumb first."""
    return _frozen(np.abs(proximal()[1]) / REFERENCE_RANGE)


@cache
def half_closed() -> np.ndarray:
    """Joint positions (25,) at the start of an episode, the palm's pose still to be set."""
    model = load()
    qpos = model.qpos0.copy()
    for digit in DIGITS:
        close = proximal()[1][DIGITS.index(digit)] * HALF_CLOSED
        coupling = model.equality(digit).data[1]
        qpos[model.joint(f"{digit}_proximal").qposadr] = close
        qpos[model.joint(f"{digit}_distal").qposadr] = close * coupling
    qpos[model.joint("thumb_base").qposadr] = THUMB_OPPOSED
    return _frozen(qpos)


@cache
def state_names() -> tuple[str, ...]:
    """Names of the numbers in a state, (48,): where things are, then how fast they move.

    Positions are in [m], quaternions wxyz, angles in [rad]. Free bodies' velocities `vx` to `vz` are the world's [m/s],
    `wx` to `wz` those about the body's own axes [rad/s].
    """
    places, speeds = [], []
    for joint in map(load().joint, range(load().njnt)):  # In the order of their addresses.
        free = joint.type[0] == mujoco.mjtJoint.mjJNT_FREE
        places += [f"{joint.name}_{axis}" for axis in FREE_PLACE] if free else [joint.name]
        speeds += [f"{joint.name}_{axis}" for axis in FREE_SPEED] if free else [f"{joint.name}_velocity"]
    return (*places, *speeds)


def _frozen(array: np.ndarray) -> np.ndarray:
    """The array, which nobody can change from now on, since all share it."""
    array.flags.writeable = False
    return array
