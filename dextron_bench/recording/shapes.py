"""Converts the visual model's geoms to Rerun's shapes. Each body is one entity that moves as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import rerun as rr

from dextron_bench.reaches import rotation
from dextron_bench.world.rendering import visuals
from dextron_bench.world.simulator import mujoco

XYZW = [1, 2, 3, 0]  # Rerun puts the scalar part of a quaternion last.


@cache
def bodies() -> Mapping[int, np.ndarray]:
    """Indices of the visible geoms of every body that has some; body 0 is the world."""
    drawn = visuals.visual_model()
    shown = np.flatnonzero(drawn.geom_group == visuals.SHOWN)
    owner = drawn.geom_bodyid[shown]
    return {int(body): shown[owner == body] for body in np.unique(owner)}


def of_body(geoms: np.ndarray) -> list[rr.AsComponents]:
    """Geoms (G,) of one body, in its frame: one mesh of all meshes, and the cylinders."""
    is_mesh = visuals.visual_model().geom_type[geoms] == mujoco.mjtGeom.mjGEOM_MESH
    return [shape(part) for shape, part in ((_mesh, geoms[is_mesh]), (_cylinders, geoms[~is_mesh])) if len(part)]


def _cylinders(geoms: np.ndarray) -> rr.Cylinders3D:
    drawn = visuals.visual_model()
    radius, half, _ = drawn.geom_size[geoms].T
    poses = {"centers": drawn.geom_pos[geoms], "quaternions": drawn.geom_quat[geoms][:, XYZW]}
    return rr.Cylinders3D.from_fields(
        lengths=2 * half, radii=radius, colors=_colours(geoms), fill_mode="solid", **poses
    )


def _colours(geoms: np.ndarray) -> np.ndarray:
    drawn = visuals.visual_model()
    return np.round(drawn.mat_rgba[drawn.geom_matid[geoms]] * 255).astype(np.uint8)


def _mesh(geoms: np.ndarray) -> rr.Mesh3D:
    """All meshes of geoms (G,) as one mesh in the frame of their body, because an entity can have only one."""
    drawn = visuals.visual_model()
    vertices, normals, faces, colours = [], [], [], []
    for geom, colour in zip(geoms, _colours(geoms), strict=True):
        mesh, corners = drawn.geom_dataid[geom], visuals.mesh_vertices(drawn, geom)
        quaternions = np.broadcast_to(drawn.geom_quat[geom], (len(corners), 4))
        triangles = drawn.mesh_face[drawn.mesh_faceadr[mesh] :][: drawn.mesh_facenum[mesh]]
        faces.append(triangles + sum(map(len, vertices)))
        vertices.append(corners)
        directions = drawn.mesh_normal[drawn.mesh_normaladr[mesh] :][: len(corners)]
        normals.append(rotation.rotate(quaternions, directions))
        colours.append(np.tile(colour, (len(quaternions), 1)))
    points, directions, triangles, colours = (np.concatenate(part) for part in (vertices, normals, faces, colours))
    return rr.Mesh3D(
        vertex_positions=points, vertex_normals=directions, triangle_indices=triangles, vertex_colors=colours
    )
