"""Converts MuJoCo's geoms to Rerun's shapes, and groups them into entities.

Palm and bottle have meshes; each is one entity that moves as a whole. The parts of the fingers form one entity for each
kind of shape, with a pose for each part: in a file, entities and their columns cost more space than numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import mujoco
import numpy as np
import rerun as rr

from dextron_bench.reaches import rotation
from dextron_bench.world.rendering import visuals

XYZW = [1, 2, 3, 0]  # Rerun puts the scalar part of a quaternion last.
MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
Kinds = Mapping[int, np.ndarray]  # Indices of geoms by kind of shape, both as in MuJoCo.


@dataclass(frozen=True, slots=True)
class Shape:
    """A kind of shape: Rerun's archetype, its field for positions, and its sizes from MuJoCo's sizes (G, 3)."""

    name: str
    archetype: Any
    position_field: str
    sizes: Callable[[np.ndarray], dict[str, np.ndarray]]

    def appearance(self, geoms: np.ndarray) -> rr.AsComponents:
        """Sizes and colours of geoms (G,), without poses."""
        return self.archetype.from_fields(**self._appearance(geoms))

    def fixed(self, geoms: np.ndarray) -> rr.AsComponents:
        """Geoms (G,) with their poses in the frame of their body."""
        poses = {self.position_field: origins(geoms), "quaternions": visuals.visual_model().geom_quat[geoms][:, XYZW]}
        return self.archetype.from_fields(**self._appearance(geoms), **poses)

    def pose_columns(self, positions: np.ndarray, quaternions: np.ndarray) -> rr.ComponentColumnList:
        """Poses of geoms in T steps, from positions (T, G, 3) of their origins and quaternions wxyz (T, G, 4)."""
        steps, count, _ = positions.shape
        poses = {self.position_field: positions.reshape(-1, 3), "quaternions": quaternions.reshape(-1, 4)[:, XYZW]}
        return self.archetype.columns(**poses).partition([count] * steps)

    def _appearance(self, geoms: np.ndarray) -> dict[str, Any]:
        return {**self.sizes(visuals.visual_model().geom_size[geoms]), "colors": _colours(geoms), "fill_mode": "solid"}


def _length_and_radius(size: np.ndarray) -> dict[str, np.ndarray]:
    return {"lengths": 2 * size[:, 1], "radii": size[:, 0]}


SIMPLE = {
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): Shape("capsules", rr.Capsules3D, "translations", _length_and_radius),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): Shape("cylinders", rr.Cylinders3D, "centers", _length_and_radius),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): Shape(
        "ellipsoids", rr.Ellipsoids3D, "centers", lambda size: {"half_sizes": size}
    ),
}


@cache
def bodies() -> Mapping[int, Kinds]:
    """Visible geoms of the bodies that have meshes, and of the world, which is body 0."""
    drawn = visuals.visual_model()
    with_meshes = np.unique([0, *drawn.geom_bodyid[drawn.geom_type == MESH]])
    return {int(body): _kinds(drawn.geom_bodyid == body) for body in with_meshes}


@dataclass(frozen=True, slots=True)
class Parts:
    """Geoms (G,) of one kind with a pose each, their bodies (G,), and their poses in the frame of their body.

    The poses are the `origins` (G, 3) [m] of Rerun's shapes and their `rotations` as quaternions wxyz (G, 4).
    """

    shape: Shape
    geoms: np.ndarray
    bodies: np.ndarray
    origins: np.ndarray
    rotations: np.ndarray

    @property
    def entity(self) -> str:
        """Entity of these parts."""
        return f"/world/fingers/{self.shape.name}"

    def poses(self, positions: np.ndarray, quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (T, G, 3) of origins and quaternions wxyz (T, G, 4) in the world frame, from the bodies' poses.

        The poses of bodies are positions (T, B, 3) and quaternions wxyz (T, B, 4).
        """
        translations, rotations = positions[:, self.bodies], quaternions[:, self.bodies]
        origins = translations + rotation.rotate(rotations, self.origins)
        return origins, rotation.multiply(rotations, self.rotations)


@cache
def fingers() -> tuple[Parts, ...]:
    """Visible geoms of all other bodies, which belong to the fingers, by kind."""
    drawn = visuals.visual_model()
    kinds = _kinds(~np.isin(drawn.geom_bodyid, list(bodies())))
    return tuple(
        Parts(SIMPLE[kind], geoms, drawn.geom_bodyid[geoms], origins(geoms), drawn.geom_quat[geoms])
        for kind, geoms in kinds.items()
    )


def fixed(kind: int, geoms: np.ndarray) -> rr.AsComponents:
    """Geoms (G,) of a kind with their poses in the frame of their body."""
    return _mesh(geoms) if kind == MESH else SIMPLE[kind].fixed(geoms)


def origins(geoms: np.ndarray) -> np.ndarray:
    """Origins [m] (G, 3) of Rerun's shapes for geoms (G,), in the frame of their body.

    The origin is the centre of the shape, but the start of a capsule.
    """
    drawn = visuals.visual_model()
    half = np.where(drawn.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_CAPSULE, drawn.geom_size[geoms, 1], 0.0)
    up = rotation.rotate(drawn.geom_quat[geoms], np.array([0.0, 0.0, 1.0]))
    return drawn.geom_pos[geoms] - up * half[:, None]


def _kinds(mask: np.ndarray) -> Kinds:
    """The visible geoms that are True in a mask (G,) over all geoms, by kind."""
    drawn = visuals.visual_model()
    geoms = np.flatnonzero(mask & (drawn.geom_group == visuals.SHOWN))
    return {int(kind): geoms[drawn.geom_type[geoms] == kind] for kind in np.unique(drawn.geom_type[geoms])}


def _colours(geoms: np.ndarray) -> np.ndarray:
    drawn = visuals.visual_model()
    return np.round(drawn.mat_rgba[drawn.geom_matid[geoms]] * 255).astype(np.uint8)


def _mesh(geoms: np.ndarray) -> rr.Mesh3D:
    """All meshes of geoms (G,) as one mesh in the frame of their body, because an entity can have only one."""
    drawn = visuals.visual_model()
    vertices, normals, faces, colours = [], [], [], []
    for geom, colour in zip(geoms, _colours(geoms), strict=True):
        mesh = drawn.geom_dataid[geom]
        rows = slice(drawn.mesh_vertadr[mesh], drawn.mesh_vertadr[mesh] + drawn.mesh_vertnum[mesh])
        triangles = drawn.mesh_face[drawn.mesh_faceadr[mesh] :][: drawn.mesh_facenum[mesh]]
        quaternions = np.broadcast_to(drawn.geom_quat[geom], (drawn.mesh_vertnum[mesh], 4))
        faces.append(triangles + sum(map(len, vertices)))
        vertices.append(drawn.geom_pos[geom] + rotation.rotate(quaternions, drawn.mesh_vert[rows]))
        normals.append(
            rotation.rotate(quaternions, drawn.mesh_normal[drawn.mesh_normaladr[mesh] :][: len(quaternions)])
        )
        colours.append(np.tile(colour, (len(quaternions), 1)))
    points, directions, triangles, colours = (np.concatenate(part) for part in (vertices, normals, faces, colours))
    return rr.Mesh3D(
        vertex_positions=points, vertex_normals=directions, triangle_indices=triangles, vertex_colors=colours
    )
