"""N episodes at once on a MuJoCo batch; the one place that steps physics in bulk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from mujoco.batch import Batch

from dextron_bench.reaches.reach import PALM_AHEAD, Path
from dextron_bench.world import model, task


@dataclass(frozen=True, slots=True)
class Step:
    """What one control step brought, each array (n,) beside states (n, 48)."""

    states: np.ndarray
    rewards: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray

    @property
    def ended(self) -> np.ndarray:
        """True where the episode is over, shape (n,)."""
        return self.terminated | self.truncated


class Engine:
    """Slots for episodes that are begun, stepped and forked independently.

    Equal paths and actions give bit-equal episodes whatever the slot, the number of slots and of threads.
    """

    def __init__(self, slots: int, threads: int = 0) -> None:
        """Makes room for `slots` episodes on `threads` threads (0: one per processor)."""
        compiled = model.load()
        self._batch = Batch(compiled, slots, threads)
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._ctrl = self._batch.bind("ctrl")
        self._mocap_pos = self._batch.bind("mocap_pos")
        self._mocap_quat = self._batch.bind("mocap_quat")
        self._batch.reset()
        self._fresh = self._batch.state[0].copy()
        self._progress = task.Progress.empty(slots)
        longest = task.STEP_LIMIT + 1
        self._positions = np.zeros((slots, longest, 3))
        self._quaternions = np.zeros((slots, longest, 4))

    @property
    def slots(self) -> int:
        """Number of episodes there is room for."""
        return len(self._qpos)

    def begin(self, ids: np.ndarray, paths: Sequence[Path]) -> np.ndarray:
        """Starts an episode in each slot of `ids` (n,) along its path; returns the first states (n, 48)."""
        lengths = np.array([len(path) for path in paths])
        for slot, path in zip(ids, paths, strict=True):
            n = min(len(path), self._positions.shape[1])
            self._positions[slot, :n], self._positions[slot, n:] = path.positions[:n], path.positions[n - 1]
            self._quaternions[slot, :n], self._quaternions[slot, n:] = path.quaternions[:n], path.quaternions[n - 1]
        self._batch.state[ids] = self._fresh
        qpos = np.tile(model.half_closed(), (len(ids), 1))
        qpos[:, model.PALM_POSITION] = self._positions[ids, 0] + PALM_AHEAD
        qpos[:, model.PALM_QUATERNION] = self._quaternions[ids, 0]
        self._qpos[ids] = qpos
        self._mocap_pos[ids, 0], self._mocap_quat[ids, 0] = self._positions[ids, 0], self._quaternions[ids, 0]
        states = self.states(ids)
        self._progress.begin(ids, states, lengths)
        return states

    def states(self, ids: np.ndarray) -> np.ndarray:
        """A copy of the states (n, 48) of slots `ids`."""
        return np.concatenate([self._qpos[ids], self._qvel[ids]], axis=1)

    def step(self, ids: np.ndarray, actions: np.ndarray) -> Step:
        """Advances slots `ids` (n,) by one control step under actions (n, 1) in [-1, 1]."""
        self._ctrl[ids] = task.commands(actions)
        pose = self._progress.step[ids] + 1
        self._mocap_pos[ids, 0], self._mocap_quat[ids, 0] = self._positions[ids, pose], self._quaternions[ids, pose]
        self._batch.step(np.sort(ids), nstep=model.substeps())
        states = self.states(ids)
        return Step(states, *self._progress.advance(ids, states))

    def fork(self, source: np.ndarray, target: np.ndarray) -> None:
        """Copies the episodes of slots `source` (n,), as they stand, into slots `target` (n,)."""
        for rows in (self._batch.state, self._positions, self._quaternions):
            rows[target] = rows[source]
        self._progress.copy(source, target)

    def save(self, ids: np.ndarray) -> dict[str, np.ndarray]:
        """Copies of all that the episodes in slots `ids` (n,) go on from, but their paths."""
        return {name: rows[ids].copy() for name, rows in self._rows().items()}

    def load(self, ids: np.ndarray, saved: dict[str, np.ndarray]) -> None:
        """Puts slots `ids` (n,), begun on the same paths, where those were that `save` was told of."""
        for name, rows in self._rows().items():
            rows[ids] = saved[name]

    def _rows(self) -> dict[str, np.ndarray]:
        return {
            "state": self._batch.state,
            **{field.name: getattr(self._progress, field.name) for field in fields(self._progress)},
        }
