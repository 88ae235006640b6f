"""Settings: everything random about one episode, frozen, so that it can be played again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Protocol

import numpy as np
import pandas as pd

from dextron_bench.reaches.reach import Path, Reach, path, scaled_duration

OFFSET = 0.06  # [m] offsets are uniform in [-OFFSET, OFFSET] (table I).


@dataclass(frozen=True, slots=True)
class Setting:
    """One episode's randomness: the reach, the offset of its grasp from the bottle, its duration."""

    reach: str
    offset_x: float  # [m]
    offset_y: float  # [m]
    duration_noise: float  # standard normal


class UnknownReach(KeyError):
    """A reach that the source does not have."""

    def __init__(self, name: str, source: str, some: Sequence[str]) -> None:
        super().__init__(f"no reach {name!r} in source {source!r}; it has names like {', '.join(some[:3])}")

    def __str__(self) -> str:
        return str(self.args[0])


class Source(Protocol):
    """Where reaches come from: `real`, `synthetic` or `minjerk`."""

    name: str
    names: tuple[str, ...]

    def sample(self, rng: np.random.Generator) -> Setting:
        """Draws the setting of one episode (paper, II.B)."""
        ...

    def path(self, setting: Setting) -> Path:
        """What the hand follows in that setting; raises UnknownReach, ReachError."""
        ...

    def stratum(self, reach: str) -> Stratum:
        """The groups that the reach belongs to; raises UnknownReach."""
        ...

    def duration(self, setting: Setting) -> float:
        """How long the hand moves in that setting [s]; raises UnknownReach."""
        ...


@dataclass(frozen=True, slots=True)
class Stratum:
    """Groups by which results are told apart: subject, and start region (ring 0 to 3, angle 0 to 3)."""

    subject: str
    ring: int
    angle: int


class ReachSource:
    """A source made of reaches: uniform over them, with uniform offsets and normal duration noise."""

    def __init__(self, name: str, reaches: Sequence[Reach]) -> None:
        self.name = name
        self._reaches = {reach.name: reach for reach in reaches}
        self.names = tuple(self._reaches)

    def reach(self, name: str) -> Reach:
        """The reach of that name; raises UnknownReach."""
        try:
            return self._reaches[name]
        except KeyError:
            raise UnknownReach(name, self.name, self.names) from None

    def sample(self, rng: np.random.Generator) -> Setting:
        """Draws a setting; noise that would make the reach faster than it was recorded is drawn again."""
        name = self.names[rng.integers(len(self.names))]
        offset_x, offset_y = rng.uniform(-OFFSET, OFFSET, 2)
        recorded = self.reach(name).duration
        while True:
            noise = float(rng.standard_normal())
            if scaled_duration(recorded, noise) >= recorded:
                return Setting(name, float(offset_x), float(offset_y), noise)

    def path(self, setting: Setting) -> Path:
        """The centred, shifted and scaled path of a setting; raises UnknownReach, ReachError."""
        return path(self.reach(setting.reach), setting.offset_x, setting.offset_y, setting.duration_noise)

    def stratum(self, reach: str) -> Stratum:
        """Subject and start region of a reach; raises UnknownReach."""
        found = self.reach(reach)
        return Stratum(found.subject, found.ring, found.angle)

    def duration(self, setting: Setting) -> float:
        """Scaled duration of a setting's reach [s]; raises UnknownReach."""
        return float(scaled_duration(self.reach(setting.reach).duration, setting.duration_noise))


def to_frame(settings: Sequence[Setting]) -> pd.DataFrame:
    """A table with one setting a row and the fields of `Setting` as columns."""
    return pd.DataFrame([asdict(setting) for setting in settings])


def from_frame(frame: pd.DataFrame) -> list[Setting]:
    """The settings of a table that has the fields of `Setting` among its columns."""
    columns = ("reach", "offset_x", "offset_y", "duration_noise")
    return [
        Setting(str(r), float(x), float(y), float(n)) for r, x, y, n in zip(*(frame[c] for c in columns), strict=True)
    ]
