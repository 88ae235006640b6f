"""Where the time of a physics step goes: MuJoCo's stages one by one, in states along episodes of experts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import mujoco
import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.world import model, task
from tests.benchmarks.measure import Row, scaled, store_rows, time_once
from tests.benchmarks.workload import PreparedSource, draw_cases

EPISODES, EVERY, REPEATS, ROUNDS = 8, 10, 20, 3  # A state is taken every 10 steps; each stage has 20 calls, 3 times.
SETTLING = 2  # Steps before the measurement, so that the solver starts warm, as in an episode.
Stage = Callable[[mujoco.MjModel, mujoco.MjData], object]
STAGES: dict[str, tuple[Stage, ...]] = {  # In the order in which a step calls them.
    "kinematics and inertia": (
        *(mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex),
        *(mujoco.mj_tendon, mujoco.mj_makeM, mujoco.mj_factorM),
    ),
    "collision": (mujoco.mj_collision,),
    "constraints": (
        *(mujoco.mj_makeConstraint, mujoco.mj_island, mujoco.mj_transmission, mujoco.mj_projectConstraint),
    ),
    "velocity, actuation and acceleration": (
        *(mujoco.mj_fwdVelocity, mujoco.mj_fwdActuation, mujoco.mj_fwdAcceleration),
    ),
    "constraint solver": (mujoco.mj_fwdConstraint,),
    "integration": (mujoco.mj_Euler,),
}


def states() -> Iterator[mujoco.MjData]:
    """The physics in states along episodes, with the controls and the carrier's pose of the next step."""
    cases = draw_cases(scaled(EPISODES))
    source, data = PreparedSource(cases), mujoco.MjData(model.load())
    for _, episode in rollout(ExpertAgent(), source, cases, threads=1):
        path = source.path(episode.setting)
        for step in range(0, len(episode.actions), EVERY):
            data.qpos[:], data.qvel[:] = np.split(episode.states[step], [model.load().nq])
            data.ctrl[:] = task.commands(episode.actions[step][None])[0]
            pose = min(step + 1, len(path) - 1)
            data.mocap_pos[0], data.mocap_quat[0] = path.positions[pose], path.quaternions[pose]
            mujoco.mj_step(model.load(), data, nstep=SETTLING)
            yield data


def seconds_of(work: Callable[[], object]) -> float:
    """The least seconds of a call, over ROUNDS of REPEATS calls."""
    return min(time_once(lambda: [work() for _ in range(REPEATS)]) for _ in range(ROUNDS)) / REPEATS


def profile() -> tuple[dict[str, float], float]:
    """Mean seconds of each stage, and of a whole step."""
    physics = model.load()
    stage_seconds, step_seconds, count = dict.fromkeys(STAGES, 0.0), 0.0, 0
    for data in states():
        start = data.qpos.copy(), data.qvel.copy()
        for name, functions in STAGES.items():
            stage_seconds[name] += sum(seconds_of(partial(function, physics, data)) for function in functions)
        data.qpos[:], data.qvel[:] = start
        step_seconds += seconds_of(partial(mujoco.mj_step, physics, data))
        data.qpos[:], data.qvel[:] = start
        count += 1
    return {name: seconds / count for name, seconds in stage_seconds.items()}, step_seconds / count


def test_physics_profile(benchmark: BenchmarkFixture):
    seconds, step = benchmark.pedantic(profile, rounds=1, iterations=1)
    whole = "a whole step of MuJoCo"
    rows = [Row(f"Physics: {name}", "us", 1e6 * part, whole, 1e6 * step) for name, part in seconds.items()]
    store_rows(benchmark, *rows)


def test_the_stages_are_all_of_a_step():
    """Called in order, they give the state after a step, bit for bit."""
    physics, expected = model.load(), mujoco.MjData(model.load())
    for data in states():
        mujoco.mj_copyData(expected, physics, data)
        mujoco.mj_step(physics, expected)
        for function in (function for functions in STAGES.values() for function in functions):
            function(physics, data)
        np.testing.assert_array_equal(data.qpos, expected.qpos)
        np.testing.assert_array_equal(data.qvel, expected.qvel)
