"""The 3D scene and the plots of a recording match the physics, and are read back as they were written."""

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


def test_poses_contacts_and_signals_are_read_back(tmp_path: Path) -> None:
    """Rerun stores shapes as float32 and plotted lines as float64."""
    played = episode(6)
    file = tmp_path / "episode.rrd"
    recording.write(file, played, PATH, {})
    moving = [chunk for chunk in RrdReader(file).store().stream().to_chunks() if not chunk.is_static]
    written = {(chunk.entity_path, name): column for chunk in moving for name, column in columns(chunk).items()}
    positions, quaternions, contacts = scene.poses(played.states)
    for body, entity in ((model.load().body(name).id, f"/world/{name}") for name in ("palm", "bottle")):
        np.testing.assert_array_equal(written[entity, "Transform3D:translation"], positions[:, body].astype(np.float32))
        xyzw = quaternions[:, body][:, [1, 2, 3, 0]].astype(np.float32)
        np.testing.assert_array_equal(written[entity, "Transform3D:quaternion"], xyzw)
    points = np.concatenate(contacts).astype(np.float32)
    np.testing.assert_array_equal(written[scene.CONTACTS, "Points3D:positions"].reshape(-1, 3), points)
    for parts in shapes.fingers():
        shape, entity = parts.shape, f"/world/fingers/{parts.shape.name}"
        origins, rotations = (array.astype(np.float32) for array in parts.poses(positions, quaternions))
        name = shape.archetype.__name__
        np.testing.assert_array_equal(written[entity, f"{name}:{shape.position_field}"], origins.reshape(-1, 3))
        np.testing.assert_array_equal(written[entity, f"{name}:quaternions"], rotations.reshape(-1, 4)[:, [1, 2, 3, 0]])
    centre = task.palm_centre(played.states)
    segments = np.stack([centre[:-1], centre[1:]], axis=1).reshape(-1, 3)
    np.testing.assert_array_equal(written[scene.TRACE, "LineStrips3D:strips"], segments.astype(np.float32))
    np.testing.assert_array_equal(written["/signals/closure", "Scalars:scalars"][:, 0], task.closure(played.states))
    lines = [task.distance(played.states), task.bottle_height(played.states), np.full(7, task.LIFTED)]
    np.testing.assert_array_equal(written["/signals/metres", "Scalars:scalars"].reshape(7, 3), np.stack(lines, axis=1))


def columns(chunk: Chunk) -> dict[str, np.ndarray]:
    """The numbers (N, -1) of each component; lists are concatenated."""
    numbers = {}
    for name, column in zip(chunk.to_record_batch().schema.names, chunk.to_record_batch().columns, strict=True):
        width = 1
        while hasattr(column, "flatten") and hasattr(column.type, "value_type"):
            width = getattr(column.type, "list_size", width)
            column = column.flatten()
        if pa.types.is_floating(column.type):
            numbers[name] = column.to_numpy(zero_copy_only=False).reshape(-1, width)
    return numbers


def test_the_shapes_of_the_fingers_have_the_poses_of_the_physics() -> None:
    """All 27 have MuJoCo's poses. Rerun's capsules go from their origin along +z, MuJoCo's are centred on it."""
    played, drawn = episode(1), visuals.visual_model()
    data = mujoco.MjData(drawn)
    data.qpos[:] = played.states[1, : drawn.nq]
    mujoco.mj_kinematics(drawn, data)
    positions, quaternions, _ = scene.poses(played.states)
    count = 0
    for parts in shapes.fingers():
        geoms = parts.geoms
        origins, rotations = (array[1] for array in parts.poses(positions, quaternions))
        w, x, y, z = rotations.T
        z_axis = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
        np.testing.assert_allclose(z_axis, data.geom_xmat[geoms].reshape(-1, 3, 3)[:, :, 2], atol=1e-12)
        half = drawn.geom_size[geoms, 1:2] * (parts.shape.name == "capsules")
        np.testing.assert_allclose(origins + half * z_axis, data.geom_xpos[geoms], atol=1e-12)
        count += len(geoms)
    assert count == 27


def test_bodies_have_the_poses_of_the_states() -> None:
    played = episode(4)
    positions, quaternions, _ = scene.poses(played.states)
    bottle, palm = model.load().body("bottle").id, model.load().body("palm").id
    np.testing.assert_array_equal(positions[:, bottle], played.states[:, :3])
    np.testing.assert_array_equal(positions[:, palm], played.states[:, model.PALM_POSITION])
    assert quaternions.shape == (5, 13 + 1, 4)
