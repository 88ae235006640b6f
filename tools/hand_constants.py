"""Writes what pure functions of states need of the model into `world/hand.json`, whenever `hand.xml` has changed.

Example: python -m tools.hand_constants
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.world import model
from dextron_bench.world.simulator import mujoco

FILE = Path(model.__file__).with_name("hand.json")
FREE_POSITIONS, FREE_VELOCITIES = ("x", "y", "z", "qw", "qx", "qy", "qz"), ("vx", "vy", "vz", "wx", "wy", "wz")


def constants() -> dict[str, Any]:
    """The values of the functions of `world.model` that need no simulator, from the compiled model."""
    joints = [model.load().joint(f"{digit}_proximal") for digit in model.DIGITS]
    return {
        "state_names": _state_names(),
        "proximal": [int(joint.qposadr[0]) for joint in joints],
        "closed": [float(joint.range[np.argmax(np.abs(joint.range))]) for joint in joints],
        "start": model.load().key("start").qpos.tolist(),
    }


def _state_names() -> list[str]:
    positions, velocities = [], []
    for joint in map(model.load().joint, range(model.load().njnt)):  # In the order of qpos.
        free = joint.type[0] == mujoco.mjtJoint.mjJNT_FREE
        positions += [f"{joint.name}_{axis}" for axis in FREE_POSITIONS] if free else [joint.name]
        velocities += [f"{joint.name}_{axis}" for axis in FREE_VELOCITIES] if free else [f"{joint.name}_velocity"]
    return [*positions, *velocities]


if __name__ == "__main__":
    FILE.write_text(json.dumps(constants(), indent=1) + "\n", encoding="utf-8")
