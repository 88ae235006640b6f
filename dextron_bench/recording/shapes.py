"""MuJoCo's shapes as Rerun draws them, and which of them move together.

Palm and bottle, which have meshes, are an entity each, moved as a whole. The parts of the fingers are an entity for
each kind of shape, moved one by one: what costs space in a file is entities and their columns, more than numbers.
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
Kinds = Mapping[int, np.ndarray]  # Shapes by kind, as MuJoCo numbers both.


@dataclass(frozen=True, slots=True)
class Shape:
    """A kind of simple shape: Rerun's archetype, what it calls a shape's place, and its sizes from MuJoCo's (G, 3)."""

    name: str
    archetype: Any
    place: str
    sizes: Callable[[np.ndarray], dict[str, np.ndarray]]

    def look(self, geoms: np.ndarray) -> rr.AsComponents:
        """Sizes and colours of shapes (G,), wherever they are."""
        return self.archetype.from_fields(**self._look(geoms))

    def fixed(self, geoms: np.ndarray) -> rr.AsComponents:
        """Shapes (G,) where they are in their body's frame."""
        places = {self.place: origins(geoms), "quaternions": visuals.visual_model().geom_quat[geoms][:, XYZW]}
        return self.archetype.from_fields(**self._look(geoms), **places)

    def moves(self, positions: np.ndarray, quaternions: np.ndarray) -> rr.ComponentColumnList:
        """Where shapes are in T steps: positions (T, G, 3) of their origins, quaternions wxyz (T, G, 4)."""
        steps, count, _ = positions.shape
        places = {self.place: positions.reshape(-1, 3), "quaternions": quaternions.reshape(-1, 4)[:, XYZW]}
        return self.archetype.columns(**places).partition([count] * steps)

    def _look(self, geoms: np.ndarray) -> dict[str, Any]:
        return {**self.sizes(visuals.visual_model().geom_size[geoms]), "colors": _colours(geoms), "fill_mode": "solid"}


def _long(size: np.ndarray) -> dict[str, np.ndarray]:
    return {"lengths": 2 * size[:, 1], "radii": size[:, 0]}


SIMPLE = {
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): Shape("capsules", rr.Capsules3D, "translations", _long),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): Shape("cylinders", rr.Cylinders3D, "centers", _long),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): Shape(
        "ellipsoids", rr.Ellipsoids3D, "centers", lambda size: {"half_sizes": size}
    ),
}


@cache
def bodies() -> Mapping[int, Kinds]:
    """What is shown of the bodies that have meshes, and of the world, body 0; each moves as a whole."""
    drawn = visuals.visual_model()
    whole = np.unique([0, *drawn.geom_bodyid[drawn.geom_type == MESH]])
    return {int(body): _kinds(drawn.geom_bodyid == body) for body in whole}


@dataclass(frozen=True, slots=True)
class Parts:
    """Shapes (G,) of a kind that are moved one by one, with their bodies (G,), and what each is in its body's frame.

    That are the `origins` (G, 3) by which Rerun moves them, and their turns as quaternions wxyz (G, 4).
    """

    shape: Shape
    geoms: np.ndarray
    bodies: np.ndarray
    origins: np.ndarray
    turns: np.ndarray

    @property
    def entity(self) -> str:
        """Where they hang."""
        return f"/world/fingers/{self.shape.name}"

    def placed(self, positions: np.ndarray, quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """World positions (T, G, 3) of origins and quaternions wxyz (T, G, 4), from those of all bodies (T, B, ...)."""
        there, turned = positions[:, self.bodies], quaternions[:, self.bodies]
        return there + rotation.rotate(turned, self.origins), rotation.multiply(turned, self.turns)


@cache
def fingers() -> tuple[Parts, ...]:
    """What is shown of all other bodies, which are the fingers', by kind."""
    drawn = visuals.visual_model()
    kinds = _kinds(~np.isin(drawn.geom_bodyid, list(bodies())))
    return tuple(
        Parts(SIMPLE[kind], geoms, drawn.geom_bodyid[geoms], origins(geoms), drawn.geom_quat[geoms])
        for kind, geoms in kinds.items()
    )


def fixed(kind: int, geoms: np.ndarray) -> rr.AsComponents:
    """Shapes of a kind (G,) where they are in their body's frame."""
    return _mesh(geoms) if kind == MESH else SIMPLE[kind].fixed(geoms)


def origins(geoms: np.ndarray) -> np.ndarray:
    """What Rerun moves shapes (G,) by, in their body's frame, (G, 3): their centre, of a capsule its start."""
    drawn = visuals.visual_model()
    half = np.where(drawn.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_CAPSULE, drawn.geom_size[geoms, 1], 0.0)
    up = rotation.rotate(drawn.geom_quat[geoms], np.array([0.0, 0.0, 1.0]))
    return drawn.geom_pos[geoms] - up * half[:, None]


def _kinds(among: np.ndarray) -> Kinds:
    """Those of all shapes (G,) that are marked and shown, by kind."""
    drawn = visuals.visual_model()
    geoms = np.flatnonzero(among & (drawn.geom_group == visuals.SHOWN))
    return {int(kind): geoms[drawn.geom_type[geoms] == kind] for kind in np.unique(drawn.geom_type[geoms])}


def _colours(geoms: np.ndarray) -> np.ndarray:
    drawn = visuals.visual_model()
    return np.round(drawn.mat_rgba[drawn.geom_matid[geoms]] * 255).astype(np.uint8)


def _mesh(geoms: np.ndarray) -> rr.Mesh3D:
    """Meshes as one in their body's frame, since an entity has but one."""
    drawn = visuals.visual_model()
    vertices, normals, faces, colours = [], [], [], []
    for geom, colour in zip(geoms, _colours(geoms), strict=True):
        mesh = drawn.geom_dataid[geom]
        rows = slice(drawn.mesh_vertadr[mesh], drawn.mesh_vertadr[mesh] + drawn.mesh_vertnum[mesh])
        triangles = drawn.mesh_face[drawn.mesh_faceadr[mesh] :][: drawn.mesh_facenum[mesh]]
        turn = np.broadcast_to(drawn.geom_quat[geom], (drawn.mesh_vertnum[mesh], 4))
        faces.append(triangles + sum(map(len, vertices)))
        vertices.append(drawn.geom_pos[geom] + rotation.rotate(turn, drawn.mesh_vert[rows]))
        normals.append(rotation.rotate(turn, drawn.mesh_normal[drawn.mesh_normaladr[mesh] :][: len(turn)]))
        colours.append(np.tile(colour, (len(turn), 1)))
    points, outward, triangles, colours = (np.concatenate(a) for a in (vertices, normals, faces, colours))
    return rr.Mesh3D(vertex_positions=points, vertex_normals=outward, triangle_indices=triangles, vertex_colors=colours)
