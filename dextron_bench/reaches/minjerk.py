"""The source `minjerk`: simulated reaches along straight minimum-jerk paths, then a lift (Sharif et al., 2020).

The hand keeps one orientation, with the palm facing +x. Its carrier starts on an arc around the bottle, moves to a via
point beside the bottle, and rises. Each of the two legs follows the feedback form of the minimum-jerk law (Hoff and
Arbib, 1993). The jerk is constant over each control step.

The expert for this source (K = 2, d_c = 0.15) lifts the bottle in nearly every reach: 499 of 500 reaches score above
1. But 13 % of them score 17 to 19, not 20. Their via point is 15 mm or more above the start, so the rise of the hand
starts the countdown shortly before the bottle is high enough to be rewarded.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dextron_bench.errors import BadInput
from dextron_bench.reaches.reach import DECIMALS, Trajectory
from dextron_bench.reaches.setting import Setting, Stratum, UnknownReach
from dextron_bench.reaches.timing import CONTROL_STEP

REACHES = 1000  # Reaches that the source lists and samples. Names with a larger number are valid too.
NAME = re.compile(r"minjerk-\d{6}")
RADIUS = (0.25, 0.60)  # [m] first distance of the carrier from the bottle's axis, drawn uniformly.
THETA = (np.pi / 14, np.pi / 7)  # [rad] angle of the start from the -y axis toward -x, drawn uniformly.
START_HEIGHT = 0.10  # [m]
VIA = np.array([-0.045, -0.10, 0.10])  # [m] point beside the bottle at which the carrier stops.
VIA_SPREAD = 0.02  # [m] largest random change of the via point's height, up or down.
LIFT = np.array([0.0, 0.0, 0.2])  # [m]
ORIENTATION = np.array([1.0, 0.0, 1.0, 0.0]) / np.sqrt(2.0)
REACH_STEPS = 250  # Control steps of the reach: half the limit of an episode.
LIFT_STEPS = 166  # Control steps of the lift: a third of that limit.
SLACK = 0.01  # The law aims to arrive later by this share of the leg's duration, which keeps its jerk finite.
BANDS = 4  # Rings, and angles, of the start regions.


@dataclass(frozen=True, slots=True)
class Draw:
    """The random numbers of one reach: start radius [m], start angle [rad], change of the via point's height [m]."""

    radius: float
    theta: float
    height: float

    @classmethod
    def from_name(cls, name: str) -> Draw:
        """Returns the draw of a reach, from a generator that is seeded with the bytes of the reach's name."""
        rng = np.random.default_rng(list(name.encode()))
        return cls(rng.uniform(*RADIUS), rng.uniform(*THETA), rng.uniform(-VIA_SPREAD, VIA_SPREAD))


def minimum_jerk_leg(start: np.ndarray, goal: np.ndarray, steps: int) -> np.ndarray:
    """Positions [m] (steps, 3) of a motion from rest at `start` (3,) to `goal` (3,), one for each control step."""
    dt, duration = CONTROL_STEP, steps * CONTROL_STEP
    positions = np.empty((steps, 3))
    x, v, a = start, np.zeros(3), np.zeros(3)
    for k in range(steps):
        remaining = duration - k * dt + SLACK * duration
        jerk = -60.0 / remaining**3 * (x - goal) - 36.0 / remaining**2 * v - 9.0 / remaining * a
        x = x + v * dt + a * dt**2 / 2.0 + jerk * dt**3 / 6.0
        v = v + a * dt + jerk * dt**2 / 2.0
        a = a + jerk * dt
        positions[k] = x
    return positions


@lru_cache(maxsize=REACHES)
def carrier_positions(draw: Draw) -> np.ndarray:
    """Carrier positions [m] (1 + REACH_STEPS + LIFT_STEPS, 3) at every control step; read-only."""
    start = np.array([-draw.radius * np.sin(draw.theta), -draw.radius * np.cos(draw.theta), START_HEIGHT])
    via = VIA + np.array([0.0, 0.0, draw.height])
    reach = minimum_jerk_leg(start, via, REACH_STEPS)
    lift = minimum_jerk_leg(reach[-1], via + LIFT, LIFT_STEPS)
    positions = np.round(np.concatenate([start[None], reach, lift]), DECIMALS)
    positions.flags.writeable = False
    return positions


def band_index(value: float, low: float, high: float) -> int:
    """Index, from 0, of the band that holds the value, if [low, high] is cut into BANDS equal bands."""
    return min(int(BANDS * (value - low) / (high - low)), BANDS - 1)


class MinjerkSource:
    """The source `minjerk`. Its settings have no offset and no duration noise: the name determines the whole reach."""

    name = "minjerk"

    def __init__(self) -> None:
        self.names = tuple(f"minjerk-{number:06d}" for number in range(REACHES))

    def sample(self, rng: np.random.Generator) -> Setting:
        """Draws the setting of one episode, uniformly over `names`."""
        return Setting(self.names[rng.integers(REACHES)], 0.0, 0.0, 0.0)

    def path(self, setting: Setting) -> Trajectory:
        """The path of a setting. Raises UnknownReach, and BadInput if the setting has an offset or noise."""
        if (setting.offset_x, setting.offset_y, setting.duration_noise) != (0.0, 0.0, 0.0):
            raise BadInput(f"{setting}: minjerk reaches take no offset and no duration noise; set all three to 0")
        positions = carrier_positions(self._draw(setting.reach))
        return Trajectory(positions, np.tile(np.round(ORIENTATION, DECIMALS), (len(positions), 1)))

    def duration(self, setting: Setting) -> float:
        """Time for which the hand moves [s], the same in all settings."""
        return (len(self.path(setting)) - 1) * CONTROL_STEP

    def stratum(self, reach: str) -> Stratum:
        """Subject `minjerk`; ring by start radius, near to far; angle from the -x side to the -y side."""
        draw = self._draw(reach)
        return Stratum(self.name, band_index(draw.radius, *RADIUS), BANDS - 1 - band_index(draw.theta, *THETA))

    def _draw(self, name: str) -> Draw:
        if not NAME.fullmatch(name):
            raise UnknownReach(name, self.name, self.names)
        return Draw.from_name(name)
