"""The visual model differs from the physics model in nothing that scores depend on."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from dextron_bench.world import model
from dextron_bench.world.rendering import visuals

SIZES = ["nq", "nv", "nu", "nbody", "njnt", "neq", "nmocap", "qpos0"]
BODIES = ["body_mass", "body_inertia", "body_ipos", "body_iquat", "body_pos", "body_quat"]
JOINTS = ["dof_damping", "dof_armature", "jnt_range", "eq_data", "eq_solref"]
ACTUATORS = ["actuator_gainprm", "actuator_biasprm", "actuator_forcerange"]


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
        data.qpos[:] = model.initial_qpos()
        data.mocap_pos[0] = data.qpos[model.PALM_POSITION]
        data.ctrl[:] = [1.05, 1, 1, 1, 1, 1]
        mujoco.mj_step(compiled, data, nstep=200)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(*ends)
