"""Smooth closed surfaces for pictures, lofted through sections along an axis, with rounded ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

DOME = 3  # Extra sections of a rounded end.


@dataclass(frozen=True, slots=True)
class Section:
    """A superellipse at height z on the axis, with half axes x and y and its centre at (dx, dy); all in [m]."""

    z: float
    x: float
    y: float
    dx: float = 0.0
    dy: float = 0.0


def loft(sections: list[Section], power: float = 2.0, domes: tuple[float, float] = (0.0, 0.0), sides: int = 20) -> Mesh:
    """The surface through sections in order of rising z.

    The sections are elliptic for a `power` of 2, and more rectangular for a larger one. The ends bulge by `domes` [m].
    """
    rows = np.array([[s.z, s.x, s.y, s.dx, s.dy] for s in sections])
    rows = np.concatenate([_dome(rows[0], -domes[0])[::-1], rows, _dome(rows[-1], domes[1])])
    angle = 2 * np.pi * np.arange(sides) / sides
    cos, sin = (np.sign(c) * np.abs(c) ** (2 / power) for c in (np.cos(angle), np.sin(angle)))
    z, x, y, dx, dy = (column[:, None] for column in rows.T)
    rings = np.stack(np.broadcast_arrays(dx + x * cos, dy + y * sin, z), axis=-1)
    poles = np.stack([rows[[0, -1], 3], rows[[0, -1], 4], rows[[0, -1], 0]], axis=1)
    return Mesh(np.concatenate([rings.reshape(-1, 3), poles]), _faces(len(rows), sides))


@dataclass(frozen=True, slots=True)
class Mesh:
    """A closed surface: vertices [m] (n, 3), and triangles (m, 3), counter-clockwise as seen from outside."""

    vertices: np.ndarray
    faces: np.ndarray


def _dome(row: np.ndarray, bulge: float) -> np.ndarray:
    """Sections (DOME or 0, 5) that round the end section `row` over a height of `bulge` [m]."""
    if bulge == 0.0:
        return np.empty((0, len(row)))
    rise = np.linspace(0.0, np.pi / 2, DOME + 1)[1:] - 1e-3
    rows = np.tile(row, (DOME, 1))
    rows[:, 0] += bulge * np.sin(rise)
    rows[:, 1:3] *= np.cos(rise)[:, None]
    return rows


def _faces(rings: int, sides: int) -> np.ndarray:
    """Triangles between neighbouring rings, and between the end rings and the two poles, the last vertices."""
    corner = np.arange(sides)
    following = np.roll(corner, -1)
    base = sides * np.arange(rings - 1)[:, None]
    lower = np.stack([base + corner, base + following, base + following + sides], axis=-1).reshape(-1, 3)
    upper = np.stack([base + corner, base + following + sides, base + corner + sides], axis=-1).reshape(-1, 3)
    bottom = np.stack([np.full(sides, rings * sides), following, corner], axis=-1)
    last = sides * (rings - 1)
    top = np.stack([np.full(sides, rings * sides + 1), last + corner, last + following], axis=-1)
    return np.concatenate([lower, upper, bottom, top])
