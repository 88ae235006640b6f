"""The task as a dm_control environment."""

from __future__ import annotations

import copy
from collections import OrderedDict
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dextron_bench.errors import MissingPackage
from dextron_bench.reaches.reach import PALM_AHEAD, Trajectory
from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.world import model, simulator, task
from dextron_bench.world.engine import DIVERGED, STATE_BOUND, UNSTABLE
from dextron_bench.world.environment import SettingQueue, validated_action

# Packages that `import dm_control` needs and that the benchmark itself does not.
ADDITION = "dm-control dm-env dm-tree lxml wrapt"


class MissingDmControl(MissingPackage):
    """dm_control is not installed; the message says how to add it."""

    def __init__(self, name: str | None) -> None:
        super().__init__(
            f"the dm_control environment needs {name or 'dm_control'}: pip install --no-deps {ADDITION} "
            "(--no-deps: labmaze, which dm-control asks for and nothing here uses, has no wheel for this Python)"
        )


if TYPE_CHECKING:
    from dm_control.mujoco import engine as dm_mujoco
    from dm_control.mujoco import wrapper
    from dm_control.rl import control
    from dm_env import specs
else:
    try:
        dm_mujoco, wrapper = simulator.load("dm_control.mujoco.engine"), simulator.load("dm_control.mujoco.wrapper")
        control, specs = simulator.load("dm_control.rl.control"), simulator.load("dm_env.specs")
    except ModuleNotFoundError as error:
        raise MissingDmControl(error.name) from error


def load(
    reaches: str | Source = "synthetic",
    settings: Sequence[Setting] | None = None,
    seed: int | np.random.Generator | None = None,
) -> control.Environment:
    """An environment that plays `settings` in turn, again and again, or draws settings from a source of reaches.

    Takes the source or its name. Raises UnknownSource and MissingData; steps raise BadInput.
    """
    grasp = Grasp(SettingQueue(reaches, settings), np.random.default_rng(seed))
    return control.Environment(Physics.load(), grasp, n_sub_steps=model.substeps(), legacy_step=False)


class Physics(dm_mujoco.Physics):
    """The simulated hand, bottle and table; its steps are bit-equal to the engine's."""

    diverged = False  # True after a step in which a number was not finite or exceeded STATE_BOUND.

    @classmethod
    def load(cls) -> Physics:
        """A simulation with a copy of the model."""
        return cls.from_model(wrapper.MjModel(copy.copy(model.load())))

    def after_reset(self) -> None:
        """Computes derived quantities, and clears the solver's last result, which would influence the next step."""
        super().after_reset()
        self.data.qacc_warmstart[:] = 0.0

    def step(self, nstep: int = 1) -> None:
        """Advances the simulation by `nstep` physics steps. It is at rest after a step that diverges, as in the engine.

        Raises PhysicsError for any other warning of MuJoCo.
        """
        try:
            super().step(nstep)
            self.diverged = not np.abs(self.states()).max() <= STATE_BOUND  # True for NaN.
        except control.PhysicsError:
            if not self.data.warning.number[UNSTABLE].any():
                raise
            self.diverged = True
        if self.diverged:
            self.reset()

    def states(self) -> np.ndarray:
        """A copy of the state, shape (1, 48)."""
        return np.concatenate([self.data.qpos, self.data.qvel])[None]

    def move_carrier(self, path: Trajectory, step: int) -> None:
        """Moves the palm's carrier to the pose of a path at a control step, or to its last pose."""
        pose = min(step, len(path) - 1)
        self.data.mocap_pos[0] = path.positions[pose]
        self.data.mocap_quat[0] = path.quaternions[pose]


class Grasp(control.Task):
    """Close the hand in time to lift the bottle.

    `setting` is the setting of the present episode. `failure` is empty, or says that its simulation diverged, which
    ends it without a reward.
    """

    setting: Setting
    failure = ""

    def __init__(self, settings: SettingQueue, rng: np.random.Generator) -> None:
        self._settings, self._rng = settings, rng
        self._progress = task.EpisodeState.empty(1)
        self._outcome = (0.0, False, False)

    def initialize_episode(self, physics: Physics) -> None:
        """Takes the next setting, half closes the hand, and puts it at the start of the reach."""
        self.failure = ""
        self.setting = self._settings.next(self._rng)
        self._path = self._settings.source.path(self.setting)
        physics.move_carrier(self._path, 0)
        qpos = model.initial_qpos().copy()
        qpos[model.PALM_POSITION] = self._path.positions[0] + PALM_AHEAD
        qpos[model.PALM_QUATERNION] = self._path.quaternions[0]
        physics.data.qpos[:] = qpos
        self._progress.begin(np.array([0]), physics.states(), np.array([len(self._path)]))

    def before_step(self, action: np.ndarray, physics: Physics) -> None:
        """Commands the fingers and moves the hand along its path. Raises BadInput."""
        physics.set_control(task.commands(validated_action(action, (1,))[None])[0])
        physics.move_carrier(self._path, int(self._progress.step[0]) + 1)

    def after_step(self, physics: Physics) -> None:
        """Computes the reward and the end of the episode."""
        reward, terminated, truncated = self._progress.advance(np.array([0]), physics.states())
        self._outcome = (float(reward[0]), bool(terminated[0]), bool(truncated[0]))
        if physics.diverged:
            self.failure, self._outcome = DIVERGED, (0.0, True, False)

    def get_observation(self, physics: Physics) -> OrderedDict[str, np.ndarray]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The state (48,): joint positions (25), then velocities (23)."""
        return OrderedDict(state=physics.states()[0])

    def get_reward(self, physics: Physics) -> float:  # pyright: ignore[reportIncompatibleMethodOverride]
        """1 for a step of the countdown with the bottle lifted, otherwise 0."""
        return self._outcome[0]

    def get_termination(self, physics: Physics) -> float | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Discount of the last step: 0 if it was terminated, 1 if it was truncated; None during the episode."""
        _, terminated, truncated = self._outcome
        return 0.0 if terminated else 1.0 if truncated else None

    def action_spec(self, physics: Physics) -> specs.BoundedArray:  # pyright: ignore[reportIncompatibleMethodOverride]
        """One closing speed in [-1, 1]; positive closes."""
        return specs.BoundedArray((1,), np.float64, -1.0, 1.0, name="action")

    def observation_spec(self, physics: Physics) -> OrderedDict[str, specs.Array]:
        """The form of what `get_observation` returns."""
        return OrderedDict(state=specs.Array((model.STATE,), np.float64, name="state"))
