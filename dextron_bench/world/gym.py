"""The task as Gymnasium environments, registered as dextron_bench/Grasp-v0.

The info of every reset and step has the `setting` of the episode, its `episode_return` so far, and `is_success`. The
last is true from the step on which the return reaches SUCCESS.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.world import model, task
from dextron_bench.world.engine import Engine
from dextron_bench.world.environment import SettingQueue, validated_action

FRAME = (480, 360)  # [px] width and height of rendered frames.
STATE_BOUND = 1e10  # Above this, MuJoCo declares a simulation unstable.
RENDERING: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": round(1.0 / model.CONTROL_STEP)}


def observation_space() -> Box:
    """States (48,). No stable simulation exceeds these bounds."""
    return Box(-STATE_BOUND, STATE_BOUND, (model.STATE,), np.float64)


def action_space() -> Box:
    """One closing speed in [-1, 1]; positive closes."""
    return Box(-1.0, 1.0, (1,), np.float64)


def render_frames(states: np.ndarray) -> np.ndarray:
    """Pictures (n, H, W, 3), 8 bit, of states (n, 48)."""
    from dextron_bench.world.rendering import renderer  # Loads OpenGL, which most runs do not need.

    return renderer.frames(states, *FRAME)


class GraspEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """Plays one episode at a time."""

    metadata = RENDERING

    def __init__(
        self,
        reaches: str | Source = "synthetic",
        settings: Sequence[Setting] | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Plays `settings` in turn, again and again, or draws settings from a source of reaches.

        Takes the source or its name. Raises UnknownSource, and MissingData for `real` before its import.
        """
        self.observation_space, self.action_space = observation_space(), action_space()
        self.render_mode = render_mode
        self._settings = SettingQueue(reaches, settings)
        self._engine, self._slot = Engine(1, threads=1), np.array([0])
        self._live = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begins the next episode, or the one of `options["setting"]`. A seed also returns to the first setting."""
        super().reset(seed=seed)
        if seed is not None:
            self._settings.rewind()
        chosen = (options or {}).get("setting")
        self._setting = chosen or self._settings.next(self.np_random)
        states = self._engine.begin(self._slot, [self._settings.source.path(self._setting)])
        self._live, self._return = True, 0.0
        return states[0], self._info()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Advances one control step. Raises ActionError, and ResetNeeded outside an episode."""
        if not self._live:
            raise ResetNeeded("no episode is running; call reset() first")
        step = self._engine.step(self._slot, validated_action(action, (1,))[None])
        self._live, reward = not step.ended[0], float(step.rewards[0])
        self._return += reward
        return step.states[0], reward, bool(step.terminated[0]), bool(step.truncated[0]), self._info()

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """A picture (H, W, 3) of the present state; None without a render mode."""
        return render_frames(self._engine.states(self._slot))[0] if self.render_mode == "rgb_array" else None

    def _info(self) -> dict[str, Any]:
        success = self._return >= task.SUCCESS
        return {"setting": self._setting, "episode_return": self._return, "is_success": success}


class GraspVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Plays many episodes in parallel on one engine: the same as many `GraspEnv`s, but much faster.

    The step after the last step of an episode begins the next episode of that slot. It ignores the action, and its
    reward is 0.
    """

    metadata = RENDERING | {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        reaches: str | Source = "synthetic",
        settings: Sequence[Setting] | None = None,
        threads: int = 0,
        render_mode: str | None = None,
    ) -> None:
        """Like `GraspEnv`. Each slot that becomes free takes the next one of `settings`.

        `threads` as in `Engine`. Raises UnknownSource, and MissingData for `real` before its import.
        """
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_observation_space, self.single_action_space = observation_space(), action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._settings, self._engine = SettingQueue(reaches, settings), Engine(num_envs, threads)
        self._rngs = [np_random()[0] for _ in range(num_envs)]
        self._playing = np.empty(num_envs, object)
        self._states, self._returns = np.zeros((num_envs, model.STATE)), np.zeros(num_envs)
        self._ended: np.ndarray | None = None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begins an episode in every slot. Slot k is seeded by `seed + k`, or by the k-th of a list."""
        if seed is not None:
            seeds = [seed + k for k in range(self.num_envs)] if isinstance(seed, int) else seed
            pairs = zip(seeds, self._rngs, strict=True)
            self._rngs = [rng if slot_seed is None else np_random(slot_seed)[0] for slot_seed, rng in pairs]
            self._settings.rewind()
        self._ended = np.zeros(self.num_envs, bool)
        self._begin(np.arange(self.num_envs))
        return self._states.copy(), self._info()

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advances every slot by one control step. Raises ActionError, and ResetNeeded before the first reset."""
        if self._ended is None:
            raise ResetNeeded("no episodes are running; call reset() first")
        actions = validated_action(actions, (self.num_envs, 1))
        live, ended = np.flatnonzero(~self._ended), np.flatnonzero(self._ended)
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros((2, self.num_envs), bool)
        if len(live):
            step = self._engine.step(live, actions[live])
            self._states[live], rewards[live] = step.states, step.rewards
            terminated[live], truncated[live] = step.terminated, step.truncated
        self._returns += rewards
        if len(ended):
            self._begin(ended)
        self._ended = terminated | truncated
        return self._states.copy(), rewards, terminated, truncated, self._info()

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Pictures (H, W, 3), one of each slot; None without a render mode."""
        return tuple(render_frames(self._states)) if self.render_mode == "rgb_array" else None

    def _begin(self, slots: np.ndarray) -> None:
        for slot in slots:
            self._playing[slot] = self._settings.next(self._rngs[slot])
        self._states[slots] = self._engine.begin(slots, [self._settings.source.path(s) for s in self._playing[slots]])
        self._returns[slots] = 0.0

    def _info(self) -> dict[str, Any]:
        success = self._returns >= task.SUCCESS
        info = {"setting": self._playing.copy(), "episode_return": self._returns.copy(), "is_success": success}
        return info | {f"_{key}": np.ones(self.num_envs, bool) for key in info}
