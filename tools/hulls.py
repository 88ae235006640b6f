"""Writes the collision shapes of the hand into `world/hand.xml`, from the table `data/hand-hulls.csv`.

Run `python -m tools.hulls` after a change of the table. Each row of the table is a disc, and each part of
the hand is the convex hull of its discs. The discs were fitted to the support functions of the convex hulls of the
authors' meshes, with an rms error of 0.15 to 0.86 mm; they are our own numbers, and no mesh is part of this project.
"""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial import ConvexHull

SIDES = 32  # Sides of the regular polygons that stand for circles.
# The polygon's radius is this times the circle's: half way, in ratio, from the inscribed to the circumscribed polygon.
BETWEEN = (1.0 / np.cos(np.pi / SIDES)) ** 0.5
MILLIMETRE = 1e-3
DECIMALS = 7  # Of a vertex in metres.
ASSETS = re.compile(r"  <asset>.*?</asset>\n", re.DOTALL)


def table() -> pd.DataFrame:
    """The discs of every part [mm]: columns part, disc, x_mm, y_mm, z_mm (centre in the part's frame), and the radii
    and half widths of two pairs of circles about the local z, `radius_mm` at z +- `half_width_mm` and
    `bevel_radius_mm` at z +- `bevel_half_width_mm`."""
    with files("dextron_bench.data").joinpath("hand-hulls.csv").open(encoding="utf-8") as file:
        text = pd.read_csv(file, dtype=str)
    return text.astype({"disc": int, **dict.fromkeys(text.columns[2:], float)})


def disc_points(disc: pd.Series) -> np.ndarray:
    """The corners (4 SIDES, 3) of a disc's four polygons [m], in the part's frame."""
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)], axis=1)
    centre = np.array([disc["x_mm"], disc["y_mm"], disc["z_mm"]])
    rings = [
        centre + BETWEEN * disc[f"{ring}radius_mm"] * circle + [0.0, 0.0, side * disc[f"{ring}half_width_mm"]]
        for ring in ("", "bevel_")
        for side in (-1, 1)
    ]
    return np.concatenate(rings) * MILLIMETRE


def vertices(discs: pd.DataFrame) -> np.ndarray:
    """The corners (n, 3) of the convex hull of a part's discs [m], in the part's frame."""
    points = np.round(np.concatenate([disc_points(disc) for _, disc in discs.iterrows()]), DECIMALS)
    points = np.unique(points, axis=0)
    return points[np.sort(ConvexHull(points).vertices)]


def assets() -> str:
    """The `<asset>` element of `hand.xml`: one mesh for each part, with its vertices inline."""
    meshes = "".join(
        f'    <mesh name="{part}" vertex="{" ".join(f"{number:g}" for number in vertices(discs).ravel())}"/>\n'
        for part, discs in table().groupby("part", sort=False)
    )
    return f"  <asset>\n{meshes}  </asset>\n"


def main() -> None:
    """Writes the meshes into `hand.xml`."""
    file = Path(__file__).parents[1] / "dextron_bench" / "world" / "hand.xml"
    file.write_text(ASSETS.sub(assets(), file.read_text(encoding="utf-8"), count=1), encoding="utf-8")


if __name__ == "__main__":
    main()
