"""The collision shapes: discs and hulls by hand, and the model file holds what the table gives."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from dextron_bench.world import model
from tools import hulls

DISC = {"x_mm": 10.0, "y_mm": 20.0, "z_mm": 30.0, "radius_mm": 2.0, "half_width_mm": 3.0}
DISC |= {"bevel_radius_mm": 1.0, "bevel_half_width_mm": 4.0}


def test_a_disc_is_four_polygons_about_the_local_z() -> None:
    """1 / cos(pi / 32) is 1.004839, and its root 1.002416: the polygons' radii are 2.004833 and 1.002416 mm."""
    points = 1000.0 * hulls.disc_points(pd.Series(DISC)).reshape(4, 32, 3)
    np.testing.assert_allclose(
        points[:, 0], [[12.004833, 20, 27], [12.004833, 20, 33], [11.002416, 20, 26], [11.002416, 20, 34]], atol=1e-6
    )
    np.testing.assert_allclose(points[0, 8], [10, 22.004833, 27], atol=1e-6)  # A quarter of 32 corners further.


def test_corners_inside_the_hull_are_dropped() -> None:
    """A wide flat disc: the polygons of the narrow bevel lie outside of it only if they are further out in z."""
    inside = {**DISC, "bevel_half_width_mm": 2.0}
    assert len(hulls.vertices(pd.DataFrame([inside]))) == 2 * 32
    assert len(hulls.vertices(pd.DataFrame([DISC]))) == 4 * 32


def test_the_model_has_the_shapes_of_the_table() -> None:
    assert hulls.assets() in model.mjcf()


@pytest.mark.parametrize("part", ["palm", "little_distal", "thumb_proximal"])
def test_a_shape_stands_in_its_part_where_the_table_puts_it(part: str) -> None:
    """The largest z is the largest z + half width of the part's discs [mm]."""
    discs = hulls.table().query("part == @part")
    top = (discs["z_mm"] + discs[["half_width_mm", "bevel_half_width_mm"]].max(axis=1)).max()
    assert 1000.0 * hulls.vertices(discs)[:, 2].max() == pytest.approx(top, abs=1e-4)
