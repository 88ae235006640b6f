"""Reaches, which are recorded hand motions, and the path of an episode that is computed from a reach.

A path has the pose of the palm's carrier at every control step, and the simulator follows it. A reach is cleaned,
resampled by B-splines and squad, scaled in duration and centred on the bottle (paper, II.B).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from dextron_bench.errors import BadInput
from dextron_bench.reaches import rotation
from dextron_bench.reaches.timing import CONTROL_STEP

TIME_SCALE = 2.5  # New duration = TIME_SCALE x old + TIME_SHIFT + TIME_SPREAD x noise (table I).
TIME_SHIFT = 0.5  # [s]
TIME_SPREAD = 0.8  # [s]
SETTLE = 0.2  # [s] interval after `reached` over which the grasping pose is averaged.
PALM_AHEAD = np.array([0.0, 0.015, 0.0])  # [m] palm origin in the carrier's frame.
PALM_CENTRE = np.array([0.0, 0.09, 0.03])  # [m] palm centre in the palm's frame.
MIN_GAP = 0.002  # [s] a sample that follows another sooner than this is the same sample, sent twice.
DECIMALS = 9  # Poses are rounded to a nanometre, so that every processor follows the same path.


@dataclass(frozen=True)
class Reach:
    """One hand trajectory in the table's frame, with z = 0 on the table.

    `times` [s] (n,) start at 0 and rise. `positions` [m] (n, 3) and `quaternions` (n, 4), unit wxyz, are the poses of
    the palm's carrier. `reached` [s] is the time at which the hand arrives at the bottle. `ring`, 0 (near) to 3 (far),
    and `angle`, 0 (-x side) to 3 (-y side), are the start region.
    """

    name: str
    times: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray
    reached: float
    subject: str
    ring: int
    angle: int

    @property
    def duration(self) -> float:
        """Recorded duration [s]."""
        return float(self.times[-1])

    @cached_property
    def curve(self) -> Curve:
        """The smooth motion that passes through the samples."""
        return Curve.through(self.times, self.positions, self.quaternions)


@dataclass(frozen=True, slots=True)
class Curve:
    """A smooth motion through timed poses: a cubic B-spline in position, squad in orientation."""

    times: np.ndarray
    spline: BSpline
    quaternions: np.ndarray
    controls: np.ndarray = field(repr=False)

    @classmethod
    def through(cls, times: np.ndarray, positions: np.ndarray, quaternions: np.ndarray) -> Curve:
        """Interpolates times [s] (n,), positions [m] (n, 3) and sign-continuous unit quaternions (n, 4)."""
        spline = make_interp_spline(times, positions, k=3)
        return cls(times, spline, quaternions, rotation.squad_controls(quaternions))

    def __call__(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions [m] (m, 3) and unit quaternions (m, 4) at times [s] (m,) within the recording."""
        return self.spline(times), rotation.squad(self.times, self.quaternions, self.controls, times)


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Carrier poses at every control step: positions [m] (T, 3) and unit quaternions wxyz (T, 4)."""

    positions: np.ndarray
    quaternions: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)


def clean(
    times: np.ndarray, positions: np.ndarray, quaternions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Drops repeated samples, starts the clock at 0, and makes quaternions unit and continuous in sign.

    Shapes are as in `Reach`. A sample is repeated if it comes within MIN_GAP of the last one kept, or
    has the same pose.
    """
    keep = [0]
    for i in range(1, len(times)):
        last = keep[-1]
        moved = np.any(positions[i] != positions[last]) or np.any(quaternions[i] != quaternions[last])
        if moved and times[i] - times[last] >= MIN_GAP:
            keep.append(i)
    quaternions = rotation.continuous(rotation.unit(quaternions[keep]))
    return times[keep] - times[keep[0]], positions[keep], quaternions


def scaled_duration(duration: np.ndarray | float, noise: np.ndarray | float) -> np.ndarray | float:
    """Duration [s] of a reach in an episode, from its recorded duration [s] and standard normal noise (table I)."""
    return TIME_SCALE * duration + TIME_SHIFT + TIME_SPREAD * noise


def palm_centre(positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """Palm centres [m] (n, 3) in the world frame, for carrier positions [m] (n, 3) and quaternions (n, 4)."""
    return positions + rotation.rotate(quaternions, PALM_AHEAD + PALM_CENTRE)


def path(reach: Reach, offset_x: float, offset_y: float, duration_noise: float) -> Trajectory:
    """The path of one setting: resampled, scaled in time, centred on the bottle, and shifted by the offsets [m].

    Raises BadInput if the noise makes the reach faster than the recording.
    """
    duration = float(scaled_duration(reach.duration, duration_noise))
    if duration < reach.duration:
        raise BadInput(
            f"duration noise {duration_noise:.3f} makes reach {reach.name} last {duration:.2f} s, "
            f"less than the recorded {reach.duration:.2f} s; use a larger noise"
        )
    scale = duration / reach.duration
    steps = np.arange(int(np.floor(duration / CONTROL_STEP + 1e-9)) + 1) * CONTROL_STEP
    positions, quaternions = reach.curve(np.minimum(steps / scale, reach.duration))
    arrival = reach.reached * scale
    settled = (steps >= arrival) & (steps < arrival + SETTLE)
    centre = palm_centre(positions[settled].mean(axis=0), rotation.mean(quaternions[settled]))
    positions[:, 0] += offset_x - centre[0]
    positions[:, 1] += offset_y - centre[1]
    return Trajectory(np.round(positions, DECIMALS), np.round(quaternions, DECIMALS))
