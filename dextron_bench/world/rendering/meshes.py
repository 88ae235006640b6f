"""Smooth closed surfaces for pictures: sections stacked along an axis, with domed ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

DOME = 3  # Extra sections that round an end.


@dataclass(frozen=True, slots=True)
class Section:
    """A superellipse across the axis, at height z, half as wide as x and half as deep as y [m], moved by dx, dy."""

    z: float
    x: float
    y: float
    dx: float = 0.0
    dy: float = 0.0


def loft(
    sections: list[Section], power: float = 2.0, domes: tuple[float, float] = (0.0, 0.0), sides: int = 20
) -> Shell:
    """The surface through sections in rising z; 2 is elliptic, more is boxier; ends bulge by `domes` [m]."""
    rows = np.array([[s.z, s.x, s.y, s.dx, s.dy] for s in sections])
    rows = np.concatenate([_dome(rows[0], -domes[0])[::-1], rows, _dome(rows[-1], domes[1])])
    angle = 2 * np.pi * np.arange(sides) / sides
    cos, sin = (np.sign(c) * np.abs(c) ** (2 / power) for c in (np.cos(angle), np.sin(angle)))
    z, x, y, dx, dy = (column[:, None] for column in rows.T)
    rings = np.stack(np.broadcast_arrays(dx + x * cos, dy + y * sin, z), axis=-1)
    poles = np.stack([rows[[0, -1], 3], rows[[0, -1], 4], rows[[0, -1], 0]], axis=1)
    return Shell(np.concatenate([rings.reshape(-1, 3), poles]), _faces(len(rows), sides))


@dataclass(frozen=True, slots=True)
class Shell:
    """A closed surface: vertices [m] (n, 3), and triangles (m, 3) that turn counter-clockwise seen from outside."""

    vertices: np.ndarray
    faces: np.ndarray


def _dome(row: np.ndarray, bulge: float) -> np.ndarray:
    """Sections that round off the end section `row` to a height of `bulge` [m], outward; (DOME or 0, 5)."""
    if bulge == 0.0:
        return np.empty((0, len(row)))
    rise = np.linspace(0.0, np.pi / 2, DOME + 1)[1:] - 1e-3
    rows = np.tile(row, (DOME, 1))
    rows[:, 0] += bulge * np.sin(rise)
    rows[:, 1:3] *= np.cos(rise)[:, None]
    return rows


def _faces(rings: int, sides: int) -> np.ndarray:
    """Triangles between neighbouring rings, and from the end rings to the two poles, which come last."""
    here = np.arange(sides)
    there = np.roll(here, -1)
    base = sides * np.arange(rings - 1)[:, None]
    lower = np.stack([base + here, base + there, base + there + sides], axis=-1).reshape(-1, 3)
    upper = np.stack([base + here, base + there + sides, base + here + sides], axis=-1).reshape(-1, 3)
    bottom = np.stack([np.full(sides, rings * sides), there, here], axis=-1)
    last = sides * (rings - 1)
    top = np.stack([np.full(sides, rings * sides + 1), last + here, last + there], axis=-1)
    return np.concatenate([lower, upper, bottom, top])
