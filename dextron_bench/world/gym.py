"""The task as Gymnasium environments, registered as dextron_bench/Grasp-v0.

The info of every reset and step has the `setting` of the episode as a dictionary, which a reset accepts, its
`episode_return` so far, `is_success` and `failure`. `is_success` is true from the step on which the return reaches
SUCCESS. If the simulation diverged, the episode is terminated, and `failure` says so; otherwise it is empty. All values
are plain, so that wrappers and collectors can store and stack them.

The task truncates an episode after at most 500 steps. The registered `max_episode_steps` is one more, so that the
TimeLimit of `gymnasium.make` changes nothing. Actions up to 1e-6 outside [-1, 1], as rounding leaves them, are clipped.

An environment can be copied and pickled during an episode; the copy continues the episode. With the render mode
`rgb_array` it keeps a renderer until `close`. A process that was forked from one that has drawn cannot draw.
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
from dextron_bench.world import infos, model
from dextron_bench.world.arguments import (
    chosen_setting,
    reset_mask,
    seed_number,
    slot_count,
    slot_seeds,
    slot_settings,
    step_limit,
)
from dextron_bench.world.engine import DIVERGED, STATE_BOUND, Engine
from dextron_bench.world.environment import SettingQueue, validated_action
from dextron_bench.world.pictures import Pictures

RENDERING: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": round(1.0 / model.CONTROL_STEP)}


def observation_space() -> Box:
    """States (48,). No stable simulation exceeds these bounds."""
    return Box(-STATE_BOUND, STATE_BOUND, (model.STATE,), np.float64)


def action_space() -> Box:
    """One closing speed in [-1, 1]; positive closes."""
    return Box(-1.0, 1.0, (1,), np.float64)


def checked_render_mode(mode: str | None) -> str | None:
    """The mode, if it is a render mode or None; raises ValueError."""
    if mode not in (None, *RENDERING["render_modes"]):
        raise ValueError(f"no render mode {mode!r}; choose from {', '.join(RENDERING['render_modes'])}, or None")
    return mode


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

        Takes the source or its name. Raises UnknownSource, MissingData for `real` before its import, and ValueError for
        an unknown mode.
        """
        self.observation_space, self.action_space = observation_space(), action_space()
        self.render_mode, self._pictures = checked_render_mode(render_mode), Pictures()
        self._settings = SettingQueue(reaches, settings)
        self._engine, self._slot = Engine(1, threads=1), np.array([0])
        self._live = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begins the next episode, or the one of `options["setting"]`. A seed also returns to the first setting.

        Raises BadInput; UnknownReach or BadInput if the source has no path for the setting.
        """
        chosen = chosen_setting(options)
        super().reset(seed=seed_number(seed))
        if seed is not None:
            self._settings.rewind()
        self._setting = chosen or self._settings.next(self.np_random)
        states = self._engine.begin(self._slot, [self._settings.source.path(self._setting)])
        self._live, self._return = True, 0.0
        return states[0], infos.single(self._setting, self._return, "")

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Advances one control step. Raises BadInput, and ResetNeeded outside an episode."""
        if not self._live:
            raise ResetNeeded("no episode is running; call reset() first")
        step = self._engine.step(self._slot, validated_action(action, (1,))[None])
        self._live, reward = not step.ended[0], float(step.rewards[0])
        self._return += reward
        info = infos.single(self._setting, self._return, DIVERGED if step.diverged[0] else "")
        return step.states[0], reward, bool(step.terminated[0]), bool(step.truncated[0]), info

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """A picture (H, W, 3) of the present state; None without a render mode. Raises NoGraphics."""
        return self._pictures.draw(self._engine.states(self._slot))[0] if self.render_mode else None

    def close(self) -> None:
        """Frees the renderer."""
        self._pictures.close()


class GraspVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Plays many episodes in parallel on one engine: the same as many `GraspEnv`s, but much faster.

    `autoreset_mode` and `max_episode_steps` have Gymnasium's meaning. By default, the step after the last step of an
    episode begins the next episode of that slot; it ignores the action, and its reward is 0.
    """

    metadata = RENDERING | {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        reaches: str | Source = "synthetic",
        settings: Sequence[Setting] | None = None,
        threads: int = 0,
        render_mode: str | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
    ) -> None:
        """Like `GraspEnv`. Each slot that becomes free takes the next one of `settings`.

        `threads` as in `Engine`. Raises UnknownSource, MissingData for `real` before its import, and ValueError for an
        unknown mode or a number of slots or steps below 1.
        """
        self._pictures = Pictures()  # First, because older Gymnasiums close what was made in part.
        self.num_envs, self._limit = slot_count(num_envs), step_limit(max_episode_steps)
        self.render_mode = checked_render_mode(render_mode)
        self.metadata = RENDERING | {"autoreset_mode": AutoresetMode(autoreset_mode)}
        self.single_observation_space, self.single_action_space = observation_space(), action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._settings, self._engine = SettingQueue(reaches, settings), Engine(num_envs, threads)
        self._rngs = [np_random()[0] for _ in range(num_envs)]
        self._infos = infos.SlotInfos(num_envs)
        self._states, self._returns = np.zeros((num_envs, model.STATE)), np.zeros(num_envs)
        self._steps = np.zeros(num_envs, int)
        self._ended: np.ndarray | None = None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begins an episode in every slot, or where `options["reset_mask"]`, a bool array (n,), is true.

        Slot k is seeded by `seed + k`, or by the k-th of a list. If every slot is reset, a seed also returns to the
        first setting. `options["setting"]` is a setting for all these slots, or a list with one (or None) for each slot
        of the environment. Raises as `GraspEnv.reset` does; TypeError and ValueError for options of another form.
        """
        mask, settings = reset_mask(options, self.num_envs), slot_settings(options, self.num_envs)
        seeds = slot_seeds(seed, self.num_envs)
        if self._ended is None and not mask.all():
            raise ResetNeeded("no episodes are running; call reset() without a reset_mask first")
        rngs = {k: np_random(seeds[k])[0] for k in np.flatnonzero(mask).tolist() if seeds[k] is not None}
        if rngs and mask.all():
            self._settings.rewind()
        self._rngs = [rngs.get(k, rng) for k, rng in enumerate(self._rngs)]
        self._begin(np.flatnonzero(mask), settings)
        self._ended = np.zeros(self.num_envs, bool) if self._ended is None else self._ended & ~mask
        return self._states.copy(), self._info(mask, np.zeros(self.num_envs, bool))

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advances every slot by one control step. Raises BadInput, and ResetNeeded before the first reset.

        In the mode DISABLED it also raises ResetNeeded if a slot's episode is over.
        """
        if self._ended is None:
            raise ResetNeeded("no episodes are running; call reset() first")
        mode = self.metadata["autoreset_mode"]
        if mode is AutoresetMode.DISABLED and self._ended.any():
            slots = np.flatnonzero(self._ended).tolist()
            raise ResetNeeded(f"the episodes of slots {slots} are over; reset them with options['reset_mask']")
        actions = validated_action(actions, (self.num_envs, 1), ignored=self._ended)
        live, ended = np.flatnonzero(~self._ended), np.flatnonzero(self._ended)
        rewards = np.zeros(self.num_envs)
        terminated, truncated, diverged = np.zeros((3, self.num_envs), bool)
        if len(live):
            step = self._engine.step(live, actions[live])
            self._states[live], rewards[live] = step.states, step.rewards
            self._steps[live] += 1
            terminated[live], diverged[live] = step.terminated, step.diverged
            truncated[live] = step.truncated | (self._steps[live] >= self._limit)
        self._returns += rewards
        if len(ended):
            self._begin(ended)
        self._ended = terminated | truncated
        if mode is AutoresetMode.SAME_STEP and self._ended.any():
            info = self._restart(diverged)
        else:
            info = self._info(np.ones(self.num_envs, bool), diverged)
        return self._states.copy(), rewards, terminated, truncated, info

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Pictures (H, W, 3), one of each slot; None without a render mode. Raises NoGraphics."""
        return tuple(self._pictures.draw(self._states)) if self.render_mode else None

    def close_extras(self, **kwargs: Any) -> None:
        """Frees the renderer."""
        self._pictures.close()

    def _begin(self, slots: np.ndarray, settings: Sequence[Setting | None] | None = None) -> None:
        """Begins an episode in each of `slots` (n,), in the setting of that slot in `settings`, or in the next one."""
        chosen = [settings[slot] if settings else None for slot in slots]
        playing = [s or self._settings.next(self._rngs[slot]) for s, slot in zip(chosen, slots, strict=True)]
        self._states[slots] = self._engine.begin(slots, [self._settings.source.path(setting) for setting in playing])
        for slot, setting in zip(slots.tolist(), playing, strict=True):
            self._infos.begin(slot, setting)
        self._returns[slots], self._steps[slots] = 0.0, 0

    def _restart(self, diverged: np.ndarray) -> dict[str, Any]:
        """Begins the next episode where one is over; the info has the last state and info of the old episode."""
        assert self._ended is not None
        over = self._ended
        final = {"final_obs": infos.objects(self._states.copy(), over), "final_info": self._info(over, diverged)}
        self._begin(np.flatnonzero(over))
        self._ended = np.zeros(self.num_envs, bool)
        masks = {f"_{key}": over.copy() for key in final}
        return final | masks | self._info(np.ones(self.num_envs, bool), np.zeros(self.num_envs, bool))

    def _info(self, mask: np.ndarray, diverged: np.ndarray) -> dict[str, Any]:
        """The info of the slots of `mask` (n,), in which simulations have `diverged` (n,)."""
        return self._infos.of(mask, self._returns, np.where(diverged, DIVERGED, "").astype(object))
