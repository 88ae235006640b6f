"""What `stopping` sees of an episode: measurements of poses, and how they changed.

Velocities are differences of poses, because the simulated velocities of a carried hand oscillate.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dextron_bench.reaches import rotation
from dextron_bench.reaches.timing import CONTROL_STEP
from dextron_bench.world import model, task

CHANGES = (5, 10, 20, 40)  # [control steps] over which the changes of measurements are features.
CLOSING_IN = (3, 8)  # [control steps] over which the time to contact is estimated.
LAGS = (1, *CLOSING_IN, *CHANGES)
LONGEST = 2.0  # [s] largest time to contact.
UP = np.array([0.0, 0.0, 1.0])

# Columns of a measurement.
BOTTLE = slice(0, 3)  # [m] the bottle from the palm's centre, in the palm's frame.
WORLD_UP = slice(3, 6)  # The world's vertical in the palm's frame.
DISTANCE, HEIGHT, CLOSURE, TILT = 6, 7, 8, 9  # [m], [m], 0 to 1, and 1 minus the cosine of the bottle's tilt.
CENTRE = slice(10, 13)  # [m] the palm's centre in the world's frame.
QUATERNION = slice(13, 17)  # Of the palm.
WIDTH = 17
SEEN = slice(0, 10)  # The measurements that are features; the others only make velocities.
CHANGING = slice(0, 8)

COUNT = 10 + 3 + 3 + 1 + len(CLOSING_IN) + 8 * len(CHANGES) + 3


def measure(states: np.ndarray) -> np.ndarray:
    """Measurements (N, 17) of states (N, 48)."""
    centre, palm = task.palm_centre(states), states[:, model.PALM_QUATERNION]
    into_palm = rotation.conjugate(palm)
    bottle_up = rotation.rotate(states[:, model.BOTTLE_QUATERNION], UP)
    return np.concatenate(
        [
            rotation.rotate(into_palm, states[:, model.BOTTLE_POSITION] - centre),
            rotation.rotate(into_palm, UP),
            task.distance(states)[:, None],
            task.hand_height(states)[:, None],
            task.closure(states)[:, None],
            1.0 - bottle_up[:, 2:],
            centre,
            palm,
        ],
        axis=1,
    )


def describe(now: np.ndarray, past: Mapping[int, np.ndarray], first: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Features (N, COUNT) of measurements `now` (N, 17), taken `steps` (N,) control steps after the first ones.

    `past` holds the measurements (N, 17) of each of LAGS steps ago, or `first` (N, 17) if the episode is shorter.
    """
    into_palm = rotation.conjugate(now[:, QUATERNION])
    velocity = rotation.rotate(into_palm, now[:, CENTRE] - past[1][:, CENTRE]) / CONTROL_STEP
    turn = rotation.multiply(rotation.conjugate(past[1][:, QUATERNION]), now[:, QUATERNION])
    turning = 2.0 * turn[:, 1:] * np.where(turn[:, :1] < 0.0, -1.0, 1.0) / CONTROL_STEP
    speed = np.sqrt((velocity * velocity).sum(axis=1, keepdims=True))
    return np.concatenate(
        [
            now[:, SEEN],
            velocity,
            turning,
            speed,
            *(_time_to_contact(now, past[lag], lag) for lag in CLOSING_IN),
            *(now[:, CHANGING] - past[lag][:, CHANGING] for lag in CHANGES),
            now[:, HEIGHT : HEIGHT + 1] - first[:, HEIGHT : HEIGHT + 1],
            first[:, DISTANCE : DISTANCE + 1],
            steps[:, None] * CONTROL_STEP,
        ],
        axis=1,
    )


def _time_to_contact(now: np.ndarray, past: np.ndarray, lag: int) -> np.ndarray:
    """Times (N, 1) [s] until the distance is 0 if it goes on to shrink as in the last `lag` steps, at most LONGEST."""
    distance = now[:, DISTANCE : DISTANCE + 1]
    rate = (past[:, DISTANCE : DISTANCE + 1] - distance) / (lag * CONTROL_STEP)
    return np.where(rate * LONGEST > distance, distance / np.where(rate > 0.0, rate, 1.0), LONGEST)


def of_episode(states: np.ndarray) -> np.ndarray:
    """Features (T, COUNT) of all states (T, 48) of an episode."""
    measured, steps = measure(states), np.arange(len(states))
    past = {lag: measured[np.maximum(steps - lag, 0)] for lag in LAGS}
    return describe(measured, past, np.broadcast_to(measured[:1], measured.shape), steps)


class History:
    """The measurements of the last steps of N episodes, from which their features follow."""

    def __init__(self) -> None:
        self._steps = np.zeros(0, int)
        self._kept = np.zeros((0, max(LAGS) + 1, WIDTH))
        self._first = np.zeros((0, WIDTH))

    def reset(self, episodes: np.ndarray) -> None:
        """Forgets rows `episodes` (n,), which begin a new episode."""
        missing = int(episodes.max(initial=-1)) + 1 - len(self._steps)
        if missing > 0:
            self._steps = np.pad(self._steps, (0, missing))
            self._kept = np.pad(self._kept, ((0, missing), (0, 0), (0, 0)))
            self._first = np.pad(self._first, ((0, missing), (0, 0)))
        self._steps[episodes] = 0

    def add(self, states: np.ndarray) -> None:
        """Adds the next states (N, 48), one for each episode."""
        rows, measured = np.arange(len(states)), measure(states)
        begins = self._steps[rows] == 0
        self._first[rows[begins]] = measured[begins]
        self._kept[rows, self._steps[rows] % self._kept.shape[1]] = measured
        self._steps[rows] += 1

    def features(self, rows: np.ndarray) -> np.ndarray:
        """Features (n, COUNT) of the newest states of rows (n,)."""
        steps = self._steps[rows] - 1
        past = {lag: self._kept[rows, np.maximum(steps - lag, 0) % self._kept.shape[1]] for lag in (0, *LAGS)}
        return describe(past[0], past, self._first[rows], steps)
