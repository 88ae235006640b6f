"""Plays N episodes in parallel on a MuJoCo batch. Only this module steps many simulations at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from numbers import Integral
from typing import Any

import numpy as np

from dextron_bench.reaches.reach import PALM_AHEAD, Trajectory
from dextron_bench.world import model, task
from dextron_bench.world.bottle import Bottle
from dextron_bench.world.bottles import Bottles, model_bottle
from dextron_bench.world.simulator import Batch, mujoco

STATE_BOUND = 1e10  # Above this, MuJoCo declares a simulation unstable.
DIVERGED = "the simulation diverged"  # The failure of such an episode.
UNSTABLE = slice(mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQACC + 1)


@dataclass(frozen=True, slots=True)
class Step:
    """The result of one control step: states (n, 48), and the other arrays of shape (n,).

    `diverged` is true for a simulation with a number that is not finite or exceeds STATE_BOUND. Its episode is
    terminated without a reward, and its state is the model at rest.
    """

    states: np.ndarray
    rewards: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    diverged: np.ndarray

    @property
    def ended(self) -> np.ndarray:
        """True for episodes that are over, shape (n,)."""
        return self.terminated | self.truncated


class Engine:
    """Slots for episodes. Each slot begins, steps and forks independently of the others.

    Equal paths and actions give bit-equal episodes in every slot, for any number of slots and threads.
    """

    def __init__(self, slots: int, threads: int = 0) -> None:
        """Allocates `slots` slots that step on `threads` threads (0: one per processor). Raises TypeError."""
        if not isinstance(threads, Integral):
            raise TypeError(f"threads must be an integer, 0 for one per processor; got {threads!r}")
        self._threads, self._batch = threads, Batch(model.load(), slots, threads)
        self._bottles: Bottles | None = None  # Only if a bottle was ever given: other episodes pay nothing.
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._ctrl = self._batch.bind("ctrl")
        self._mocap_pos = self._batch.bind("mocap_pos")
        self._mocap_quat = self._batch.bind("mocap_quat")
        self._batch.reset()
        self._initial_state = self._batch.state[0].copy()
        self._progress = task.EpisodeState.empty(slots)
        poses = task.STEP_LIMIT + 1
        self._positions = np.zeros((slots, poses, 3))
        self._quaternions = np.zeros((slots, poses, 4))

    @property
    def slots(self) -> int:
        """Number of slots."""
        return len(self._qpos)

    def begin(self, ids: np.ndarray, paths: Sequence[Trajectory], bottles: Sequence[Bottle] = ()) -> np.ndarray:
        """Begins an episode along a path in each slot of `ids` (n,), and returns the first states (n, 48).

        Without `bottles`, one for each slot, the episodes have the model's bottle.
        """
        self._set_bottles(ids, bottles)
        self._batch.warning[ids] = 0
        lengths = np.array([len(path) for path in paths])
        for slot, path in zip(ids, paths, strict=True):
            n = min(len(path), self._positions.shape[1])
            self._positions[slot, :n], self._positions[slot, n:] = path.positions[:n], path.positions[n - 1]
            self._quaternions[slot, :n], self._quaternions[slot, n:] = path.quaternions[:n], path.quaternions[n - 1]
        self._batch.state[ids] = self._initial_state
        qpos = np.tile(model.initial_qpos(), (len(ids), 1))
        qpos[:, model.PALM_POSITION] = self._positions[ids, 0] + PALM_AHEAD
        qpos[:, model.PALM_QUATERNION] = self._quaternions[ids, 0]
        self._qpos[ids] = qpos
        self._mocap_pos[ids, 0], self._mocap_quat[ids, 0] = self._positions[ids, 0], self._quaternions[ids, 0]
        states = self.states(ids)
        self._progress.begin(ids, states, lengths)
        return states

    def _set_bottles(self, ids: np.ndarray, bottles: Sequence[Bottle]) -> None:
        if bottles and self._bottles is None:
            self._bottles = Bottles(self._batch)
        if self._bottles is not None and len(ids):
            self._bottles.set(ids, bottles or [model_bottle()] * len(ids))

    def states(self, ids: np.ndarray) -> np.ndarray:
        """A copy of the states (n, 48) of slots `ids` (n,)."""
        return np.concatenate([self._qpos[ids], self._qvel[ids]], axis=1)

    def step(self, ids: np.ndarray, actions: np.ndarray) -> Step:
        """Advances slots `ids` (n,) by one control step with actions (n, 1) in [-1, 1]."""
        self._ctrl[ids] = task.commands(actions)
        pose = self._progress.step[ids] + 1
        self._mocap_pos[ids, 0], self._mocap_quat[ids, 0] = self._positions[ids, pose], self._quaternions[ids, pose]
        self._batch.step(np.sort(ids), nstep=model.substeps())
        states = self.states(ids)
        diverged = self._diverged(ids, states)
        if diverged.any():
            self._batch.state[ids[diverged]] = self._initial_state
            states = self.states(ids)
        reward, terminated, truncated = self._progress.advance(ids, states)
        reward[diverged], terminated[diverged], truncated[diverged] = 0.0, True, False
        return Step(states, reward, terminated, truncated, diverged)

    def _diverged(self, ids: np.ndarray, states: np.ndarray) -> np.ndarray:
        """True for slots `ids` (n,), in states (n, 48), that MuJoCo has reset or would reset next, shape (n,).

        MuJoCo tests a state when a physics step begins; so the state after the last one is tested here.
        """
        is_stable = np.abs(states).max(axis=1) <= STATE_BOUND  # False for NaN.
        return ~is_stable | self._batch.warning[ids, UNSTABLE, 1].any(axis=1)

    def fork(self, source: np.ndarray, target: np.ndarray) -> None:
        """Copies the episodes of slots `source` (n,), in their present state, into slots `target` (n,)."""
        for rows in (self._batch.state, self._batch.warning, self._positions, self._quaternions):
            rows[target] = rows[source]
        self._progress.copy(source, target)
        if self._bottles is not None:
            self._bottles.copy(source, target)

    def save(self, ids: np.ndarray) -> dict[str, np.ndarray]:
        """Copies of everything that the episodes in slots `ids` (n,) need to continue, except their paths."""
        return {name: rows[ids].copy() for name, rows in self._episode_arrays().items()}

    def load(self, ids: np.ndarray, saved: dict[str, np.ndarray]) -> None:
        """Restores episodes from `save` in slots `ids` (n,), which must have begun on the same paths."""
        self._batch.warning[ids] = 0
        for name, rows in self._episode_arrays().items():
            rows[ids] = saved[name]

    def __getstate__(self) -> dict[str, Any]:
        """What a copy, or another process, needs to continue all episodes."""
        episodes = self.save(np.arange(self.slots))
        return {"threads": self._threads, "episodes": episodes, "paths": (self._positions, self._quaternions)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        ids = np.arange(len(state["episodes"]["state"]))
        self.__init__(len(ids), state["threads"])
        self._positions[:], self._quaternions[:] = state["paths"]
        self.load(ids, state["episodes"])

    def _episode_arrays(self) -> dict[str, np.ndarray]:
        """The arrays with one row for each slot, by the names that they have in checkpoints."""
        return {
            "state": self._batch.state,
            **{field.name: getattr(self._progress, field.name) for field in fields(self._progress)},
        }
