"""Pictures show the state, and the visual model differs from the physics model in nothing that scores depend on."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image

from dextron_bench.recording import stills
from dextron_bench.world import model
from dextron_bench.world.rendering import renderer, visuals
from dextron_bench.world.rendering.meshes import Section, loft

SIZES = ["nq", "nv", "nu", "nbody", "njnt", "neq", "nmocap", "qpos0"]
BODIES = ["body_mass", "body_inertia", "body_ipos", "body_iquat", "body_pos", "body_quat"]
JOINTS = ["dof_damping", "dof_armature", "jnt_range", "eq_data", "eq_solref"]
ACTUATORS = ["actuator_gainprm", "actuator_biasprm", "actuator_forcerange"]


@pytest.fixture(scope="module")
def start() -> np.ndarray:
    """The hand half closed, beside the bottle."""
    return np.concatenate([model.half_closed(), np.zeros(23)])


def orange(picture: np.ndarray) -> int:
    """Pixels of the bottle's colour."""
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    return int(((red > 120) & (red > 2 * green) & (red > 3 * blue)).sum())


@pytest.mark.parametrize("name", SIZES + BODIES + JOINTS + ACTUATORS)
def test_the_visual_model_keeps_every_quantity_of_the_physics(name: str) -> None:
    np.testing.assert_array_equal(getattr(visuals.visual_model(), name), getattr(model.load(), name))


def test_only_the_shapes_of_the_physics_model_can_collide() -> None:
    def colliding(compiled: mujoco.MjModel) -> list[str]:
        geoms = np.flatnonzero(compiled.geom_contype | compiled.geom_conaffinity)
        return [compiled.geom(geom).name for geom in geoms]

    assert colliding(visuals.visual_model()) == colliding(model.load())


def test_the_visual_model_moves_like_the_physics_model() -> None:
    ends = []
    for compiled in (model.load(), visuals.visual_model()):
        data = mujoco.MjData(compiled)
        data.qpos[:] = model.half_closed()
        data.mocap_pos[0] = data.qpos[model.PALM_POSITION]
        data.ctrl[:] = [1.05, 1, 1, 1, 1, 1]
        mujoco.mj_step(compiled, data, nstep=200)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(*ends)


def test_a_picture_shows_the_bottle_at_its_position(start: np.ndarray) -> None:
    away = start.copy()
    away[model.BOTTLE_POSITION] = 9.0
    both = renderer.frames(np.stack([start, away]), 160, 120)
    assert both.shape == (2, 120, 160, 3)
    assert both.dtype == np.uint8
    assert orange(both[0]) > 60
    assert orange(both[1]) == 0


def test_the_sky_is_at_the_top(start: np.ndarray) -> None:
    picture = renderer.render(start, 80, 60).astype(int)
    assert picture[:5].mean() > picture[-5:].mean() + 20


def test_a_picture_depends_only_on_its_state(start: np.ndarray) -> None:
    lifted = start.copy()
    lifted[2] += 0.2
    pictures = renderer.frames(np.stack([lifted, start, lifted]), 80, 60)
    np.testing.assert_array_equal(pictures[0], pictures[2])
    assert (pictures[0] != pictures[1]).any()


@pytest.mark.slow
def test_more_lights_soften_shadows(start: np.ndarray) -> None:
    hard, soft = (renderer.render(start, 160, 120, "top", lights).astype(int) for lights in (1, 6))
    steps = [np.abs(np.diff(picture.sum(axis=2), axis=0)).max() for picture in (hard, soft)]
    assert (hard != soft).any()
    assert steps[1] <= steps[0]


def test_the_error_for_an_unknown_camera_lists_the_cameras(start: np.ndarray) -> None:
    with pytest.raises(
        renderer.UnknownCamera, match="no camera 'left'; choose from behind, front, hand, hero, side, top"
    ):
        renderer.render(start, camera="left")


def test_without_graphics_the_error_says_what_to_install(start: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(renderer, "find_library", lambda name: None)
    with pytest.raises(renderer.NoGraphics, match=r"libegl1 .*libosmesa6"):
        renderer.render(start)
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    with pytest.raises(renderer.NoGraphics, match="MUJOCO_GL='disabled'"):
        renderer.render(start)


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


def test_the_pictured_grasp_succeeds() -> None:
    assert stills.play_lift().success


def test_a_pictured_hand_has_the_given_closure(start: np.ndarray) -> None:
    joints, closed = model.proximal()
    np.testing.assert_allclose(stills.hand_alone(start, 0.25)[joints], closed / 4)
    np.testing.assert_array_equal(stills.hand_alone(start, model.HALF_CLOSED)[14:], start[14:])


@pytest.mark.slow
def test_pictures_are_written_small_and_wide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stills, "LAMPS", 1)
    sizes = {file.name: Image.open(file).size for file in stills.write_pictures(tmp_path)}
    assert sizes == {"hero.png": (1280, 720), "hand-open-half-closed.png": (1278, 320)}
    assert all(file.stat().st_size < 400_000 for file in tmp_path.iterdir())
