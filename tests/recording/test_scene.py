"""What recordings show in space and in plots: as the physics has it, and read back as it was written."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa
from rerun.chunk import Chunk, RrdReader

from dextron_bench import recording
from dextron_bench.recording import scene, shapes
from dextron_bench.world import model, task
from dextron_bench.world.rendering import visuals
from tests.recording.test_episode_file import PATH, episode


def test_poses_contacts_and_signals_are_read_back_as_they_are(tmp_path: Path) -> None:
    """Shapes in space as Rerun keeps them, in float32; what is plotted in float64."""
    made = episode(6)
    file = tmp_path / "episode.rrd"
    recording.write(file, made, PATH, {})
    kept = [chunk for chunk in RrdReader(file).store().stream().to_chunks() if not chunk.is_static]
    found = {(chunk.entity_path, name): column for chunk in kept for name, column in columns(chunk).items()}
    positions, quaternions, touched = scene.poses(made.states)
    for body, entity in ((model.load().body(name).id, f"/world/{name}") for name in ("palm", "bottle")):
        np.testing.assert_array_equal(found[entity, "Transform3D:translation"], positions[:, body].astype(np.float32))
        turned = quaternions[:, body][:, [1, 2, 3, 0]].astype(np.float32)
        np.testing.assert_array_equal(found[entity, "Transform3D:quaternion"], turned)
    points = np.concatenate(touched).astype(np.float32)
    np.testing.assert_array_equal(found[scene.CONTACTS, "Points3D:positions"].reshape(-1, 3), points)
    for parts in shapes.fingers():
        form, entity = parts.shape, f"/world/fingers/{parts.shape.name}"
        there, turns = (each.astype(np.float32) for each in parts.placed(positions, quaternions))
        name = form.archetype.__name__
        np.testing.assert_array_equal(found[entity, f"{name}:{form.place}"], there.reshape(-1, 3))
        np.testing.assert_array_equal(found[entity, f"{name}:quaternions"], turns.reshape(-1, 4)[:, [1, 2, 3, 0]])
    centre = task.palm_centre(made.states)
    legs = np.stack([centre[:-1], centre[1:]], axis=1).reshape(-1, 3)
    np.testing.assert_array_equal(found[scene.TRACE, "LineStrips3D:strips"], legs.astype(np.float32))
    np.testing.assert_array_equal(found["/signals/closure", "Scalars:scalars"][:, 0], task.closure(made.states))
    lines = [task.distance(made.states), task.bottle_height(made.states), np.full(7, task.LIFTED)]
    np.testing.assert_array_equal(found["/signals/metres", "Scalars:scalars"].reshape(7, 3), np.stack(lines, axis=1))


def columns(chunk: Chunk) -> dict[str, np.ndarray]:
    """Each component's numbers (N, -1), lists laid end to end."""
    told = {}
    for name, column in zip(chunk.to_record_batch().schema.names, chunk.to_record_batch().columns, strict=True):
        width = 1
        while hasattr(column, "flatten") and hasattr(column.type, "value_type"):
            width = getattr(column.type, "list_size", width)
            column = column.flatten()
        if pa.types.is_floating(column.type):
            told[name] = column.to_numpy(zero_copy_only=False).reshape(-1, width)
    return told


def test_the_fingers_shapes_are_where_the_physics_has_them() -> None:
    """MuJoCo's own places and turns of all 27; Rerun's capsules run from their start along +z, MuJoCo's are centred."""
    made, drawn = episode(1), visuals.visual_model()
    data = mujoco.MjData(drawn)
    data.qpos[:] = made.states[1, : drawn.nq]
    mujoco.mj_kinematics(drawn, data)
    positions, quaternions, _ = scene.poses(made.states)
    counted = 0
    for parts in shapes.fingers():
        geoms = parts.geoms
        there, turns = (each[1] for each in parts.placed(positions, quaternions))
        w, x, y, z = turns.T
        along = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
        np.testing.assert_allclose(along, data.geom_xmat[geoms].reshape(-1, 3, 3)[:, :, 2], atol=1e-12)
        half = drawn.geom_size[geoms, 1:2] * (parts.shape.name == "capsules")
        np.testing.assert_allclose(there + half * along, data.geom_xpos[geoms], atol=1e-12)
        counted += len(geoms)
    assert counted == 27


def test_bodies_move_as_the_states_say() -> None:
    played = episode(4)
    positions, quaternions, _ = scene.poses(played.states)
    bottle, palm = model.load().body("bottle").id, model.load().body("palm").id
    np.testing.assert_array_equal(positions[:, bottle], played.states[:, :3])
    np.testing.assert_array_equal(positions[:, palm], played.states[:, model.PALM_POSITION])
    assert quaternions.shape == (5, 13 + 1, 4)
