"""The simulated-trajectory world: straight minimum-jerk reaches, then a lift (Sharif et al., 2020).

The hand keeps one orientation, with the palm facing +x. Its carrier starts on an arc about the bottle,
comes to a via point beside the bottle, and rises. Each leg follows the feedback form of the
minimum-jerk law (Hoff and Arbib, 1993), the jerk held constant over each control step.

The expert for this world (K = 2, d_c = 0.15) lifts the bottle in nearly every reach (499 of 500 score above 1),
but 13 % of them stay one to three short of 20: from a via point 15 mm or more above the start, the hand is
up by HAND_RAISED, and the countdown runs, a moment before the bottle is up far enough to be rewarded.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dextron_bench.reaches.reach import CONTROL_STEP, DECIMALS, Path, ReachError
from dextron_bench.reaches.setting import Setting, Stratum, UnknownReach

REACHES = 1000  # Reaches that are listed and sampled; further numbers are known by name.
NAME = re.compile(r"minjerk-\d{6}")
RADIUS = (0.25, 0.60)  # [m] first distance of the carrier from the bottle's axis, drawn uniformly.
THETA = (np.pi / 14, np.pi / 7)  # [rad] angle of the start from the -y axis toward -x, drawn uniformly.
START_HEIGHT = 0.10  # [m]
VIA = np.array([-0.045, -0.10, 0.10])  # [m] where the carrier stops beside the bottle.
VIA_SPREAD = 0.02  # [m] the via point's height is drawn this far up or down.
LIFT = np.array([0.0, 0.0, 0.2])  # [m]
ORIENTATION = np.array([1.0, 0.0, 1.0, 0.0]) / np.sqrt(2.0)
REACH_STEPS = 250  # Control steps of the reach: half the limit of an episode.
LIFT_STEPS = 166  # Control steps of the lift: a third of that limit.
SLACK = 0.01  # Share of a leg's time that is always left to go, so that the law stays finite.
BANDS = 4  # Rings and angles of a start region.


@dataclass(frozen=True, slots=True)
class Draw:
    """What is random about one reach: start radius [m], start angle [rad], change of the via height [m]."""

    radius: float
    theta: float
    height: float

    @classmethod
    def of(cls, name: str) -> Draw:
        """The draw that belongs to a reach's name, from a generator seeded by the name's bytes."""
        rng = np.random.default_rng(list(name.encode()))
        return cls(rng.uniform(*RADIUS), rng.uniform(*THETA), rng.uniform(-VIA_SPREAD, VIA_SPREAD))


def leg(start: np.ndarray, goal: np.ndarray, steps: int) -> np.ndarray:
    """Positions [m] (steps, 3) of a motion from rest at `start` to `goal` (3,), one for each control step."""
    dt, duration = CONTROL_STEP, steps * CONTROL_STEP
    positions = np.empty((steps, 3))
    x, v, a = start, np.zeros(3), np.zeros(3)
    for k in range(steps):
        left = duration - k * dt + SLACK * duration
        jerk = -60.0 / left**3 * (x - goal) - 36.0 / left**2 * v - 9.0 / left * a
        x = x + v * dt + a * dt**2 / 2.0 + jerk * dt**3 / 6.0
        v = v + a * dt + jerk * dt**2 / 2.0
        a = a + jerk * dt
        positions[k] = x
    return positions


@lru_cache(maxsize=REACHES)
def carrier(draw: Draw) -> np.ndarray:
    """Carrier positions [m] (1 + REACH_STEPS + LIFT_STEPS, 3) at every control step; read-only."""
    start = np.array([-draw.radius * np.sin(draw.theta), -draw.radius * np.cos(draw.theta), START_HEIGHT])
    via = VIA + np.array([0.0, 0.0, draw.height])
    reach = leg(start, via, REACH_STEPS)
    lift = leg(reach[-1], via + LIFT, LIFT_STEPS)
    positions = np.round(np.concatenate([start[None], reach, lift]), DECIMALS)
    positions.flags.writeable = False
    return positions


def band(value: float, low: float, high: float) -> int:
    """Which of BANDS equal bands of [low, high] holds the value, counted from 0."""
    return min(int(BANDS * (value - low) / (high - low)), BANDS - 1)


class MinjerkSource:
    """The source `minjerk`. Its settings have no offset and no duration noise: a name says everything."""

    name = "minjerk"

    def __init__(self) -> None:
        self.names = tuple(f"minjerk-{number:06d}" for number in range(REACHES))

    def sample(self, rng: np.random.Generator) -> Setting:
        """Draws the setting of one episode: any of `names`."""
        return Setting(self.names[rng.integers(REACHES)], 0.0, 0.0, 0.0)

    def path(self, setting: Setting) -> Path:
        """The path of a setting; raises UnknownReach, and ReachError where it has an offset or noise."""
        if (setting.offset_x, setting.offset_y, setting.duration_noise) != (0.0, 0.0, 0.0):
            raise ReachError(f"{setting}: minjerk reaches take no offset and no duration noise; set all three to 0")
        positions = carrier(self._draw(setting.reach))
        return Path(positions, np.tile(np.round(ORIENTATION, DECIMALS), (len(positions), 1)))

    def duration(self, setting: Setting) -> float:
        """How long the hand moves [s], the same in all."""
        return (len(self.path(setting)) - 1) * CONTROL_STEP

    def stratum(self, reach: str) -> Stratum:
        """Subject `minjerk`; ring by start radius, near to far; angle from nearest -x to nearest -y."""
        draw = self._draw(reach)
        return Stratum(self.name, band(draw.radius, *RADIUS), BANDS - 1 - band(draw.theta, *THETA))

    def _draw(self, name: str) -> Draw:
        if not NAME.fullmatch(name):
            raise UnknownReach(name, self.name, self.names)
        return Draw.of(name)
