"""Applies a track to the episodes of a rollout: delays their actions, and adds errors to the states that agents see.

Errors follow from the setting of an episode alone, so they are the same in any slot, order and process.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dextron_bench.reaches import rotation
from dextron_bench.reaches.setting import Setting
from dextron_bench.splits.tracks import Noise, Track
from dextron_bench.storage import hashing
from dextron_bench.world import model, task

POSES = ((model.BOTTLE_POSITION, model.BOTTLE_QUATERNION), (model.PALM_POSITION, model.PALM_QUATERNION))


class Perturbation:
    """A track applied to the episodes in N slots. With a plain track, states and actions pass unchanged."""

    def __init__(self, track: Track, slots: int) -> None:
        self._track = track
        self._step = np.zeros(slots, int)
        self._late = np.zeros((slots, track.delay + 1, 1))
        if track.noise is not None:
            self._errors = np.zeros((slots, task.STEP_LIMIT + 1, model.STATE))
            self._is_lost = np.zeros((slots, task.STEP_LIMIT + 1), bool)
            self._last = np.zeros((slots, model.STATE))

    def begin(self, slots: np.ndarray, settings: Sequence[Setting]) -> None:
        """Episodes on some settings begin in slots (n,)."""
        self._step[slots], self._late[slots] = 0, 0.0
        if self._track.noise is None:
            return
        for slot, setting in zip(slots, settings, strict=True):
            seed = int(hashing.digest(f"{self._track.name} {setting!r}".encode())[:16], 16)
            rng = np.random.default_rng(seed)
            self._errors[slot] = rng.standard_normal(self._errors.shape[1:])
            self._is_lost[slot] = rng.random(self._is_lost.shape[1]) < self._track.noise.lost
            self._is_lost[slot, 0] = False

    def sense(self, states: np.ndarray) -> np.ndarray:
        """What the agent sees of states (N, 48), one for each slot."""
        if self._track.noise is None:
            return states
        rows = np.arange(len(states))
        step = np.minimum(self._step, self._errors.shape[1] - 1)
        sensed = with_errors(states, self._errors[rows, step], self._track.noise)
        self._last = np.where(self._is_lost[rows, step][:, None], self._last, sensed)
        return self._last.copy()

    def delay(self, actions: np.ndarray) -> np.ndarray:
        """The actions (N, 1) that arrive now, which were sent some steps ago; 0 before the first has arrived."""
        self._step += 1
        if not self._track.delay:
            return actions
        self._late = np.concatenate([self._late[:, 1:], actions[:, None]], axis=1)
        return self._late[:, 0].copy()


def with_errors(states: np.ndarray, errors: np.ndarray, noise: Noise) -> np.ndarray:
    """States (N, 48) with standard normal errors (N, 48), scaled by a noise; orientations stay of unit length."""
    sensed = states.copy()
    for position, quaternion in POSES:
        sensed[:, position] += noise.position * errors[:, position]
        half_turn = 0.5 * noise.rotation * errors[:, quaternion][:, 1:]
        turn = rotation.unit(np.concatenate([np.ones((len(states), 1)), half_turn], axis=1))
        sensed[:, quaternion] = rotation.multiply(states[:, quaternion], turn)
    sensed[:, model.FINGER_ANGLES] += noise.angle * errors[:, model.FINGER_ANGLES]
    sensed[:, model.LINEAR_VELOCITIES] += noise.velocity * errors[:, model.LINEAR_VELOCITIES]
    sensed[:, model.ANGULAR_VELOCITIES] += noise.turning * errors[:, model.ANGULAR_VELOCITIES]
    return sensed
