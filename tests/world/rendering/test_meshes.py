"""Lofted meshes are closed, face outward, and have the volume of their solid."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from dextron_bench.world.rendering.meshes import Section, loft


@pytest.mark.parametrize("domes", [(0.0, 0.0), (0.01, 0.02)])
def test_meshes_are_closed_and_face_outward(domes: tuple[float, float]) -> None:
    mesh = loft([Section(0.0, 0.02, 0.01), Section(0.05, 0.03, 0.02, 0.01)], domes=domes)
    edges = Counter((int(a), int(b)) for face in mesh.faces for a, b in zip(face, np.roll(face, -1), strict=True))
    assert all(count == 1 and edges[b, a] == 1 for (a, b), count in edges.items())
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    assert (a * np.cross(b, c)).sum() / 6 > 0


def test_a_mesh_of_equal_circles_has_the_volume_of_its_prism() -> None:
    mesh = loft([Section(0.0, 1.0, 1.0), Section(2.0, 1.0, 1.0)], sides=24)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(2.0 * 12.0 * np.sin(2 * np.pi / 24))
