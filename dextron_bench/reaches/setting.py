"""Settings, which hold everything random about one episode, so that the episode can be played again."""

from __future__ import annotations

import copy
import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Protocol, Self

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput, NotFound
from dextron_bench.reaches.reach import Reach, Trajectory, path, scaled_duration

OFFSET = 0.06  # [m] offsets are uniform in [-OFFSET, OFFSET] (table I).
LIMITS = {"offset_x": 1.0, "offset_y": 1.0, "duration_noise": 10.0}  # Largest sizes [m, m, standard deviations].


@dataclass(frozen=True, slots=True)
class Setting:
    """Everything random about one episode: the reach, the offset of its grasp from the bottle, its duration noise.

    Raises BadInput unless the reach is a name and every number lies within LIMITS. No draw reaches these limits:
    a noise of 10 makes a reach 8 s longer, and an episode lasts at most 10 s.
    """

    reach: str
    offset_x: float  # [m]
    offset_y: float  # [m]
    duration_noise: float  # standard normal

    def __post_init__(self) -> None:
        if not isinstance(self.reach, str):
            raise BadInput(f"the reach of a setting must be a name; got {self.reach!r}")
        for name, limit in LIMITS.items():
            value = getattr(self, name)
            if not isinstance(value, numbers.Real) or not math.fabs(value) <= limit:  # This form also refuses NaN.
                raise BadInput(f"{name} of a setting must be a number in [-{limit:g}, {limit:g}]; got {value!r}")


def checked_setting(value: object) -> Setting:
    """The value, if it is a setting, or the setting of a mapping with its fields; raises BadInput."""
    if isinstance(value, Mapping) and set(value) == {field.name for field in fields(Setting)}:
        return Setting(**value)
    if not isinstance(value, Setting):
        raise BadInput(f"a setting must be a dextron_bench Setting; got {value!r}")
    return value


def plain(setting: Setting) -> dict[str, str | float]:
    """A setting as a dictionary of a text and Python floats, which `checked_setting` reads."""
    return {name: value if isinstance(value, str) else float(value) for name, value in asdict(setting).items()}


class UnknownReach(NotFound):
    """The source has no reach of that name; the message gives examples of its names."""

    def __init__(self, name: str, source: str, names: Sequence[str]) -> None:
        super().__init__(f"no reach {name!r} in source {source!r}; it has names like {', '.join(names[:3])}")

    def __str__(self) -> str:
        return str(self.args[0])


class Source(Protocol):
    """A set of reaches and a distribution of settings: `real`, `synthetic` or `minjerk`."""

    name: str
    names: tuple[str, ...]

    def sample(self, rng: np.random.Generator) -> Setting:
        """Draws the setting of one episode (paper, II.B)."""
        ...

    def path(self, setting: Setting) -> Trajectory:
        """The path that the hand follows in that setting. Raises UnknownReach or BadInput."""
        ...

    def stratum(self, reach: str) -> Stratum:
        """The subject and start region of the reach. Raises UnknownReach."""
        ...

    def duration(self, setting: Setting) -> float:
        """Time for which the hand moves in that setting [s]. Raises UnknownReach."""
        ...


@dataclass(frozen=True, slots=True)
class Stratum:
    """The groups of a reach, for results by group: subject and start region (ring 0 to 3, angle 0 to 3)."""

    subject: str
    ring: int
    angle: int


class ReachSource:
    """A source with a list of reaches. It draws reaches and offsets uniformly, and normal duration noise."""

    def __init__(self, name: str, reaches: Sequence[Reach]) -> None:
        self.name = name
        self._reaches = {reach.name: reach for reach in reaches}
        self.names = tuple(self._reaches)

    def reach(self, name: str) -> Reach:
        """The reach of that name. Raises UnknownReach."""
        try:
            return self._reaches[name]
        except KeyError:
            raise UnknownReach(name, self.name, self.names) from None

    def on_reaches(self, names: Sequence[str]) -> Self:
        """The same source, which draws settings on these reaches alone."""
        part = copy.copy(self)
        part.names = tuple(names)
        return part

    def new_reaches(self, count: int, rng: np.random.Generator) -> list[str]:
        """Names of reaches that `names` has not; none if the source has no others."""
        return []

    def sample(self, rng: np.random.Generator) -> Setting:
        """Draws a setting."""
        name = self.names[rng.integers(len(self.names))]
        offset_x, offset_y = rng.uniform(-OFFSET, OFFSET, 2)
        return Setting(name, float(offset_x), float(offset_y), self.sample_noise(name, rng))

    def sample_noise(self, name: str, rng: np.random.Generator) -> float:
        """Draws the duration noise of a reach. It draws again if that makes the reach faster than the recording."""
        recorded = self.reach(name).duration
        while True:
            noise = float(rng.standard_normal())
            if scaled_duration(recorded, noise) >= recorded:
                return noise

    def path(self, setting: Setting) -> Trajectory:
        """The scaled, centred and shifted path of a setting. Raises UnknownReach or BadInput."""
        return path(self.reach(setting.reach), setting.offset_x, setting.offset_y, setting.duration_noise)

    def stratum(self, reach: str) -> Stratum:
        """Subject and start region of the reach of that name. Raises UnknownReach."""
        trajectory = self.reach(reach)
        return Stratum(trajectory.subject, trajectory.ring, trajectory.angle)

    def duration(self, setting: Setting) -> float:
        """Scaled duration of a setting's reach [s]. Raises UnknownReach."""
        return float(scaled_duration(self.reach(setting.reach).duration, setting.duration_noise))


def to_frame(settings: Sequence[Setting]) -> pd.DataFrame:
    """A table with one row for each setting, and the fields of `Setting` as columns."""
    return pd.DataFrame([asdict(setting) for setting in settings])


def from_frame(frame: pd.DataFrame) -> list[Setting]:
    """The settings in a table, which has the fields of `Setting` among its columns."""
    columns = ("reach", "offset_x", "offset_y", "duration_noise")
    return [
        Setting(str(r), float(x), float(y), float(n)) for r, x, y, n in zip(*(frame[c] for c in columns), strict=True)
    ]
