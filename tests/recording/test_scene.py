"""The 3D scene and the plots of a recording match the physics, and are read back as they were written."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk, RrdReader

from dextron_bench import recording
from dextron_bench.recording import scene, shapes
from dextron_bench.world import model, task
from dextron_bench.world.rendering import visuals
from tests.recording.test_episode_file import PATH, episode
from tools import hulls


def test_poses_contacts_and_signals_are_read_back(tmp_path: Path) -> None:
    """Rerun stores shapes as float32 and plotted lines as float64."""
    played = episode(6)
    file = tmp_path / "episode.rrd"
    recording.write(file, played, PATH, {})
    moving = [chunk for chunk in RrdReader(file).store().stream().to_chunks() if not chunk.is_static]
    written = {(chunk.entity_path, name): column for chunk in moving for name, column in columns(chunk).items()}
    positions, quaternions, contacts = scene.poses(played.states)
    names = ("palm", "bottle", *(f"{digit}_distal" for digit in model.DIGITS))
    for body, entity in ((model.load().body(name).id, f"/world/{name}") for name in names):
        np.testing.assert_array_equal(written[entity, "Transform3D:translation"], positions[:, body].astype(np.float32))
        xyzw = quaternions[:, body][:, [1, 2, 3, 0]].astype(np.float32)
        np.testing.assert_array_equal(written[entity, "Transform3D:quaternion"], xyzw)
    points = np.concatenate(contacts).astype(np.float32)
    np.testing.assert_array_equal(written[scene.CONTACTS, "Points3D:positions"].reshape(-1, 3), points)
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


def test_the_meshes_of_a_body_have_the_corners_of_the_physics() -> None:
    """The extremes of the first mesh that is drawn for a finger part equal its collision shape, in its frame."""
    drawn = visuals.visual_model()
    for name in ("index_proximal", "thumb_distal", "palm"):
        geom = drawn.geom(name).id
        assert geom in shapes.bodies()[drawn.geom_bodyid[geom]]
        discs = hulls.table().query("part == @name")
        expected, actual = hulls.vertices(discs), visuals.mesh_vertices(drawn, geom)
        np.testing.assert_allclose(actual.min(axis=0), expected.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(actual.max(axis=0), expected.max(axis=0), atol=1e-6)


def test_all_meshes_of_a_body_become_one_mesh_and_its_cylinders_stay() -> None:
    """A fingertip has a shell, a pad and a hinge; vertices and triangles of the meshes add up."""
    drawn = visuals.visual_model()
    geoms = shapes.bodies()[drawn.body("index_distal").id]
    mesh, cylinders = shapes.of_body(geoms)
    meshes = drawn.geom_dataid[geoms[drawn.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_MESH]]
    assert len(meshes) == 2
    contents = {batch.component_descriptor().component: batch for batch in mesh.as_component_batches()}
    counts = {name.split(":")[-1]: len(batch.as_arrow_array()) for name, batch in contents.items()}
    assert counts["vertex_positions"] == counts["vertex_normals"] == drawn.mesh_vertnum[meshes].sum()
    assert counts["triangle_indices"] == drawn.mesh_facenum[meshes].sum()
    assert isinstance(cylinders, rr.Cylinders3D)


def test_bodies_have_the_poses_of_the_states() -> None:
    played = episode(4)
    positions, quaternions, _ = scene.poses(played.states)
    bottle, palm = model.load().body("bottle").id, model.load().body("palm").id
    np.testing.assert_array_equal(positions[:, bottle], played.states[:, :3])
    np.testing.assert_array_equal(positions[:, palm], played.states[:, model.PALM_POSITION])
    assert quaternions.shape == (5, 13 + 1, 4)
