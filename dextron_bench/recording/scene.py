"""The 3D scene of a recording: static shapes, poses at each step, contacts, and the planned and real palm path."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from dextron_bench.reaches import reach
from dextron_bench.recording import shapes
from dextron_bench.world import model, task
from dextron_bench.world.simulator import mujoco

TRACE = "/world/trace"  # One segment for each step; the layout shows those up to the cursor.
CONTACTS = "/world/contacts"
PATH_COLOUR, TRACE_COLOUR, CENTRE_COLOUR = (130, 180, 255), (255, 190, 60), (255, 90, 60)
CONTACT_COLOUR = (230, 60, 200)


def timelines(first: int, last: int) -> list[rr.TimeColumn]:
    """Index columns of control steps `first` to `last`: their numbers, and their times in seconds."""
    return timelines_at(np.arange(first, last + 1))


def timelines_at(steps: np.ndarray) -> list[rr.TimeColumn]:
    """Index columns of control steps (N,): their numbers, and their times in seconds."""
    nanoseconds = np.round(steps * model.CONTROL_STEP * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn("step", sequence=steps), rr.TimeColumn("seconds", duration=nanoseconds)]


def static(entity: str, *contents: rr.AsComponents) -> Chunk:
    """Contents of an entity that stay constant during the episode, in one chunk, because a chunk costs 2 to 3 kB."""
    batches = [batch for content in contents for batch in content.as_component_batches()]
    filled = [(batch, len(batch.as_arrow_array())) for batch in batches]
    return Chunk.from_columns(entity, [], [batch.partition([n]) for batch, n in filled if n])


def chunks(states: np.ndarray, first: int = 0) -> Iterable[Chunk]:
    """All that moves in the 3D view: poses, contacts and palm path for states (T, 48), which start at step `first`."""
    times = timelines(first, first + len(states) - 1)
    positions, quaternions, contacts = poses(states)
    for body in filter(None, shapes.bodies()):
        xyzw = quaternions[:, body][:, shapes.XYZW]
        transforms = rr.Transform3D.columns(translation=positions[:, body], quaternion=xyzw)
        yield Chunk.from_columns(_entity(body), times, transforms)
    points = rr.Points3D.columns(positions=np.concatenate(contacts)).partition([len(points) for points in contacts])
    yield Chunk.from_columns(CONTACTS, times, points)
    centre = task.palm_centre(states)
    segments = np.stack([centre[:-1], centre[1:]], axis=1)
    ends = timelines(first + 1, first + len(segments))
    yield Chunk.from_columns(TRACE, ends, rr.LineStrips3D.columns(strips=segments))


def planned_path(path: reach.Trajectory) -> Chunk:
    """The planned path of the palm's centre."""
    points = reach.palm_centre(path.positions, path.quaternions)
    return static("/world/path", rr.LineStrips3D([points], radii=[0.0012], colors=[PATH_COLOUR]))


def poses(states: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Poses of all bodies except the carrier, and contacts of hand and bottle, in states (T, 48).

    Returns positions [m] (T, B, 3) and quaternions wxyz (T, B, 4) in the world frame, and a list with the contact
    points [m] (C, 3) of each state.
    """
    physics = model.load()
    data = mujoco.MjData(physics)
    bodies, bottle = physics.nbody - 1, physics.body("bottle").id
    positions, quaternions = np.empty((len(states), bodies, 3)), np.empty((len(states), bodies, 4))
    contacts = []
    for step, qpos in enumerate(states[:, : physics.nq]):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(physics, data)
        mujoco.mj_collision(physics, data)
        positions[step], quaternions[step] = data.xpos[:bodies], data.xquat[:bodies]
        contacts.append((data.contact.geom.copy(), data.contact.dist.copy(), data.contact.pos.copy()))
    geoms, depths, points = map(np.concatenate, zip(*contacts, strict=True))
    pairs = physics.geom_bodyid[geoms]  # (C, 2); body 0 has the table.
    touching = (pairs == bottle).any(axis=1) & (pairs != 0).all(axis=1) & (depths < 0.0)
    steps = np.repeat(np.arange(len(states)), [len(geoms) for geoms, _, _ in contacts])
    counts = np.bincount(steps[touching], minlength=len(states))
    return positions, quaternions, np.split(points[touching], np.cumsum(counts)[:-1])


def _entity(body: int) -> str:
    """Entity of a body."""
    return f"/world/{model.load().body(body).name}"


def static_chunks() -> list[Chunk]:
    """What stays constant in the 3D view; equal for all episodes."""
    contents = {body: shapes.of_body(geoms) for body, geoms in shapes.bodies().items()}
    chunks = [static("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, *contents.pop(0))]
    contents[model.load().body("palm").id].append(
        rr.Points3D([reach.PALM_CENTRE], radii=[0.005], colors=[CENTRE_COLOUR])
    )
    chunks.append(static(CONTACTS, rr.Points3D.from_fields(radii=[0.004], colors=[CONTACT_COLOUR])))
    chunks.append(static(TRACE, rr.LineStrips3D.from_fields(radii=[0.002], colors=[TRACE_COLOUR])))
    chunks += [static(_entity(body), *parts) for body, parts in contents.items()]
    return chunks
