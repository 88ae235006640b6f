"""What is seen in space: shapes once, poses per step, and the way of the palm's centre, planned and gone."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from typing import Any

import mujoco
import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from dextron_bench.world import dressing, model, reach, rotation, task

XYZW = [1, 2, 3, 0]  # Rerun puts the scalar part of a quaternion last.
TRACE = "/world/trace"  # One leg a step; the layout shows those up to now.
CONTACTS = "/world/contacts"
PATH_COLOUR, TRACE_COLOUR, CENTRE_COLOUR = (130, 180, 255), (255, 190, 60), (255, 90, 60)
CONTACT_COLOUR = (230, 60, 200)


def timelines(first: int, last: int) -> list[rr.TimeColumn]:
    """Index columns of control steps `first` to `last`, counted and in seconds."""
    steps = np.arange(first, last + 1)
    nanoseconds = np.round(steps * model.CONTROL_STEP * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn("step", sequence=steps), rr.TimeColumn("seconds", duration=nanoseconds)]


def static(entity: str, *contents: rr.AsComponents) -> Chunk:
    """What an entity is for the whole episode. One chunk, because each costs 2 to 3 kB."""
    batches = [batch for content in contents for batch in content.as_component_batches()]
    filled = [(batch, len(batch.as_arrow_array())) for batch in batches]
    return Chunk.from_columns(entity, [], [batch.partition([n]) for batch, n in filled if n])


def chunks(states: np.ndarray, first: int = 0) -> Iterable[Chunk]:
    """Everything that moves in the 3D view for states (T, 48) of an episode from step `first` on."""
    when = timelines(first, first + len(states) - 1)
    positions, quaternions, touched = poses(states)
    for body in range(1, positions.shape[1]):
        moves = rr.Transform3D.columns(translation=positions[:, body], quaternion=quaternions[:, body][:, XYZW])
        yield Chunk.from_columns(_entity(body), when, moves)
    points = rr.Points3D.columns(positions=np.concatenate(touched)).partition([len(each) for each in touched])
    yield Chunk.from_columns(CONTACTS, when, points)
    centre = task.palm_centre(states)
    yield Chunk.from_columns("/world/palm_centre", when, rr.Points3D.columns(positions=centre))
    legs = np.stack([centre[:-1], centre[1:]], axis=1)
    later = timelines(first + 1, first + len(legs))
    yield Chunk.from_columns(TRACE, later, rr.LineStrips3D.columns(strips=legs))


def plan(path: reach.Path) -> Chunk:
    """The way that the palm's centre is to go."""
    planned = reach.palm_centre(path.positions, path.quaternions)
    return static("/world/path", rr.LineStrips3D([planned], radii=[0.0012], colors=[PATH_COLOUR]))


def poses(states: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Where everything is in states (T, 48).

    World positions [m] (T, B, 3) and quaternions wxyz (T, B, 4) of every body but the carrier, and for each state the
    points [m] (C, 3) where the hand touches the bottle.
    """
    physics = model.load()
    data = mujoco.MjData(physics)
    bodies, bottle = physics.nbody - 1, physics.body("bottle").id
    positions, quaternions = np.empty((len(states), bodies, 3)), np.empty((len(states), bodies, 4))
    touched = []
    for step, qpos in enumerate(states[:, : physics.nq]):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(physics, data)
        mujoco.mj_collision(physics, data)
        positions[step], quaternions[step] = data.xpos[:bodies], data.xquat[:bodies]
        pairs = physics.geom_bodyid[data.contact.geom]  # (C, 2); body 0 has the table.
        held = (pairs == bottle).any(axis=1) & (pairs != 0).all(axis=1) & (data.contact.dist < 0.0)
        touched.append(data.contact.pos[held])
    return positions, quaternions, touched


def _entity(body: int) -> str:
    """Where a body hangs; the table is part of the world itself."""
    return f"/world/{model.load().body(body).name}" if body else "/world/table"


def props() -> list[Chunk]:
    """What does not change in the 3D view, and is the same for every episode."""
    drawn = dressing.dressed()
    kept = [static("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)]
    kept.append(static("/world/palm_centre", rr.Points3D.from_fields(radii=[0.005], colors=[CENTRE_COLOUR])))
    kept.append(static(CONTACTS, rr.Points3D.from_fields(radii=[0.004], colors=[CONTACT_COLOUR])))
    kept.append(static(TRACE, rr.LineStrips3D.from_fields(radii=[0.002], colors=[TRACE_COLOUR])))
    groups: dict[int, dict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
    for geom in np.flatnonzero(drawn.geom_group == dressing.SHOWN):
        groups[int(drawn.geom_bodyid[geom])][int(drawn.geom_type[geom])].append(int(geom))
    for body, kinds in groups.items():
        kept.append(static(_entity(body), *(DRAWN[kind](drawn, np.array(geoms)) for kind, geoms in kinds.items())))
    return kept


def _colours(drawn: mujoco.MjModel, geoms: np.ndarray) -> np.ndarray:
    return np.round(drawn.mat_rgba[drawn.geom_matid[geoms]] * 255).astype(np.uint8)


def _solid(drawn: mujoco.MjModel, geoms: np.ndarray) -> dict[str, Any]:
    """Place and look of simple shapes in their body's frame."""
    turn = drawn.geom_quat[geoms][:, XYZW]
    look = {"colors": _colours(drawn, geoms), "fill_mode": "solid"}
    return {"centers": drawn.geom_pos[geoms], "quaternions": turn, **look}


def _cylinders(drawn: mujoco.MjModel, geoms: np.ndarray) -> rr.Cylinders3D:
    size = drawn.geom_size[geoms]
    return rr.Cylinders3D(lengths=2 * size[:, 1], radii=size[:, 0], **_solid(drawn, geoms))


def _capsules(drawn: mujoco.MjModel, geoms: np.ndarray) -> rr.Capsules3D:
    """Capsules; Rerun's start at their origin, MuJoCo's are centred."""
    size, place = drawn.geom_size[geoms], _solid(drawn, geoms)
    up = rotation.rotate(drawn.geom_quat[geoms], np.array([0.0, 0.0, 1.0]))
    start = place.pop("centers") - up * size[:, 1:2]
    return rr.Capsules3D(lengths=2 * size[:, 1], radii=size[:, 0], translations=start, **place)


def _ellipsoids(drawn: mujoco.MjModel, geoms: np.ndarray) -> rr.Ellipsoids3D:
    return rr.Ellipsoids3D(half_sizes=drawn.geom_size[geoms], **_solid(drawn, geoms))


def _meshes(drawn: mujoco.MjModel, geoms: np.ndarray) -> rr.Mesh3D:
    """Meshes as one in their body's frame, since an entity has but one."""
    vertices, normals, faces, colours = [], [], [], []
    for geom, colour in zip(geoms, _colours(drawn, geoms), strict=True):
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


DRAWN: dict[int, Callable[[mujoco.MjModel, np.ndarray], rr.AsComponents]] = {
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): _capsules,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): _cylinders,
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): _ellipsoids,
    int(mujoco.mjtGeom.mjGEOM_MESH): _meshes,
}
