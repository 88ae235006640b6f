"""What is seen in space: shapes once, poses per step, and the way of the palm's centre, planned and gone."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from dextron_bench.reaches import reach
from dextron_bench.recording import shapes
from dextron_bench.world import model, task

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
    for body in filter(None, shapes.bodies()):
        turns = quaternions[:, body][:, shapes.XYZW]
        moves = rr.Transform3D.columns(translation=positions[:, body], quaternion=turns)
        yield Chunk.from_columns(_entity(body), when, moves)
    for parts in shapes.fingers():
        yield Chunk.from_columns(parts.entity, when, parts.shape.moves(*parts.placed(positions, quaternions)))
    points = rr.Points3D.columns(positions=np.concatenate(touched)).partition([len(each) for each in touched])
    yield Chunk.from_columns(CONTACTS, when, points)
    centre = task.palm_centre(states)
    legs = np.stack([centre[:-1], centre[1:]], axis=1)
    later = timelines(first + 1, first + len(legs))
    yield Chunk.from_columns(TRACE, later, rr.LineStrips3D.columns(strips=legs))


def planned_path(path: reach.Path) -> Chunk:
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
    contacts = []
    for step, qpos in enumerate(states[:, : physics.nq]):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(physics, data)
        mujoco.mj_collision(physics, data)
        positions[step], quaternions[step] = data.xpos[:bodies], data.xquat[:bodies]
        contacts.append((data.contact.geom.copy(), data.contact.dist.copy(), data.contact.pos.copy()))
    geoms, depths, points = map(np.concatenate, zip(*contacts, strict=True))
    pairs = physics.geom_bodyid[geoms]  # (C, 2); body 0 has the table.
    held = (pairs == bottle).any(axis=1) & (pairs != 0).all(axis=1) & (depths < 0.0)
    steps = np.repeat(np.arange(len(states)), [len(each) for each, _, _ in contacts])
    touched = np.bincount(steps[held], minlength=len(states))
    return positions, quaternions, np.split(points[held], np.cumsum(touched)[:-1])


def _entity(body: int) -> str:
    """Where a body hangs."""
    return f"/world/{model.load().body(body).name}"


def static_chunks() -> list[Chunk]:
    """What does not change in the 3D view, and is the same for every episode."""
    whole = {body: [shapes.fixed(*each) for each in kinds.items()] for body, kinds in shapes.bodies().items()}
    kept = [static("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, *whole.pop(0))]
    whole[model.load().body("palm").id].append(rr.Points3D([reach.PALM_CENTRE], radii=[0.005], colors=[CENTRE_COLOUR]))
    kept.append(static(CONTACTS, rr.Points3D.from_fields(radii=[0.004], colors=[CONTACT_COLOUR])))
    kept.append(static(TRACE, rr.LineStrips3D.from_fields(radii=[0.002], colors=[TRACE_COLOUR])))
    kept += [static(_entity(body), *parts) for body, parts in whole.items()]
    kept += [static(parts.entity, parts.shape.look(parts.geoms)) for parts in shapes.fingers()]
    return kept
