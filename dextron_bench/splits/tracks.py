"""Tracks: conditions that a real prosthesis adds to a split, such as a delay of the commands or noise in the sensors.

A split under a track has the name of both, as in `test+delay-100`. It has the settings of the split, so that scores are
compared setting by setting. An agent does not know which track it plays.
"""

from __future__ import annotations

from dataclasses import dataclass

from dextron_bench.errors import NotFound

PLUS = "+"  # Between the names of a split and of a track.


@dataclass(frozen=True, slots=True)
class Noise:
    """Errors of the sensors: standard deviations of normal errors, and the share of readings that are lost.

    `position` [m] applies to the positions of bottle and palm, `rotation` [rad] to their orientations, `angle` [rad] to
    the fingers' angles. Velocities have the errors of `velocity` [m/s] and `turning` [rad/s]. A lost reading, of all 48
    numbers, repeats the last one.
    """

    position: float
    rotation: float
    angle: float
    velocity: float
    turning: float
    lost: float


@dataclass(frozen=True, slots=True)
class Range:
    """A quantity of the bottle that differs from row to row: `mass` [kg], `friction` or `radius` [m], and its range."""

    quantity: str
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Track:
    """A condition: actions arrive `delay` control steps late, states have `noise`, or each row has its own `bottle`."""

    name: str = ""
    delay: int = 0
    noise: Noise | None = None
    bottle: Range | None = None


PLAIN = Track()
DEGREE = 0.017453292519943295  # [rad]
DELAYS = {40: 2, 100: 5, 200: 10, 300: 15}  # Control steps by their duration [ms].
BOTTLES = {
    "bottle-mass": Track("bottle-mass", bottle=Range("mass", 0.25, 1.0)),
    "bottle-friction": Track("bottle-friction", bottle=Range("friction", 0.5, 1.5)),
    "bottle-radius": Track("bottle-radius", bottle=Range("radius", 0.020, 0.032)),
}
TRACKS = {
    **{f"delay-{duration}": Track(f"delay-{duration}", delay=steps) for duration, steps in DELAYS.items()},
    "sensing-1": Track("sensing-1", noise=Noise(0.002, 0.5 * DEGREE, 0.5 * DEGREE, 0.02, 0.1, 0.01)),
    "sensing-2": Track("sensing-2", noise=Noise(0.005, 2.0 * DEGREE, 2.0 * DEGREE, 0.05, 0.3, 0.05)),
    **BOTTLES,
}


class UnknownTrack(NotFound):
    """A track that does not exist."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no track {name!r}; choose from {', '.join(TRACKS)}")


def name_of(split: str, track: str) -> str:
    """The name of a split under a track; raises UnknownTrack."""
    if track not in TRACKS:
        raise UnknownTrack(track)
    return f"{split}{PLUS}{track}"


def parse(name: str) -> tuple[str, Track]:
    """The split and the track of a name; the track is PLAIN if the name has none. Raises UnknownTrack."""
    split, plus, track = name.partition(PLUS)
    if not plus:
        return name, PLAIN
    if track not in TRACKS:
        raise UnknownTrack(track)
    return split, TRACKS[track]
