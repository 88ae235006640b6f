"""The task as pure functions on arrays: measurements, commands, rewards, and the ends of episodes.

States have shape (N, 48): bottle pose, palm pose and 11 finger angles, then their velocities (paper, II.A).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import PALM_CENTRE
from dextron_bench.reaches.timing import STEP_LIMIT
from dextron_bench.world import model

LIFTED = 0.25  # [m] height of the bottle's centre from which a step is rewarded.
FALLEN = 0.110  # [m] height of the bottle's centre below which the bottle counts as fallen.
HAND_RAISED = 0.145  # [m] rise of the hand above its start that starts the countdown.
COUNTDOWN = 20  # Control steps that can earn a reward, after the bottle or the hand has risen.
HOLD = 20  # Control steps for which the hand holds the last pose of a reach.
SUCCESS = 20.0  # Sum of rewards of a successful grasp.
LEEWAY = 1e-6  # How far outside [-1, 1] an action may lie: wrappers and sums in 32 bits round that much.


def palm_centre(states: np.ndarray) -> np.ndarray:
    """Palm centres in the world frame [m], shape (N, 3)."""
    palm = states[:, model.PALM_POSITION]
    return palm + rotation.rotate(states[:, model.PALM_QUATERNION], PALM_CENTRE)


def distance(states: np.ndarray) -> np.ndarray:
    """Horizontal distance from the palm centre to the bottle's axis [m], shape (N,)."""
    offset = palm_centre(states)[:, :2] - states[:, model.BOTTLE_POSITION][:, :2]
    return np.sqrt((offset * offset).sum(axis=1))


def closure(states: np.ndarray) -> np.ndarray:
    """Closure of the most closed digit, from 0 (open) to 1 (closed), shape (N,)."""
    joints, closed = model.proximal()
    return (states[:, joints] / closed).max(axis=1)


def bottle_height(states: np.ndarray) -> np.ndarray:
    """Height of the bottle's centre above the table [m], shape (N,)."""
    return states[:, 2]


def hand_height(states: np.ndarray) -> np.ndarray:
    """Height of the palm's origin above the table [m], shape (N,)."""
    return states[:, 9]


def is_lifted(states: np.ndarray) -> np.ndarray:
    """True if the bottle counts as lifted, shape (N,)."""
    return bottle_height(states) >= LIFTED


def has_fallen(states: np.ndarray) -> np.ndarray:
    """True if the bottle has fallen, shape (N,)."""
    return bottle_height(states) < FALLEN


def clipped(actions: np.ndarray) -> np.ndarray:
    """Actions of any shape, clipped to [-1, 1]; NaN where one is not finite or outside by more than LEEWAY.

    Every environment and `rollout` apply this rule to what an agent sends. It leaves actions in the range as they are.
    """
    return np.where(np.abs(actions) <= 1.0 + LEEWAY, np.clip(actions, -1.0, 1.0), np.nan)


def commands(actions: np.ndarray) -> np.ndarray:
    """Actuator controls (N, 6) for actions (N, 1): angle of the thumb's base [rad], velocity of every digit [rad/s]."""
    opposed = np.full_like(actions, model.THUMB_OPPOSED)
    return np.concatenate([opposed, actions * model.command_gain()], axis=1)


@dataclass(slots=True)
class EpisodeState:
    """Progress of N episodes, on which rewards and ends depend in addition to the states; each array (N,).

    `step` counts control steps. `left` is the number of countdown steps that remain, -1 before the countdown. `last` is
    the step at which the end of the reach has been held for HOLD steps. `raised` [m] is the height of the hand that
    starts the countdown.
    """

    step: np.ndarray
    left: np.ndarray
    last: np.ndarray
    raised: np.ndarray

    @classmethod
    def empty(cls, n: int) -> EpisodeState:
        """Progress of N episodes that have not begun."""
        return cls(np.zeros(n, int), np.full(n, -1), np.zeros(n, int), np.zeros(n))

    def begin(self, ids: np.ndarray, states: np.ndarray, path_lengths: np.ndarray) -> None:
        """Begins episodes `ids` (n,) in states (n, 48), along paths with these numbers of poses (n,)."""
        self.step[ids] = 0
        self.left[ids] = -1
        self.last[ids] = np.minimum(path_lengths - 1 + HOLD, STEP_LIMIT)
        self.raised[ids] = hand_height(states) + HAND_RAISED

    def copy(self, source: np.ndarray, target: np.ndarray) -> None:
        """Copies the progress of episodes `source` (n,) to episodes `target` (n,)."""
        for entries in (self.step, self.left, self.last, self.raised):
            entries[target] = entries[source]

    def advance(self, ids: np.ndarray, states: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Reward, terminated and truncated, each (n,), of the step that took episodes `ids` to states (n, 48).

        The first step with the bottle lifted or the hand raised starts the countdown and earns nothing. Each of the
        COUNTDOWN steps after it earns 1 if the bottle is lifted. The last of them ends the episode.
        """
        step = self.step[ids] + 1
        left = self.left[ids]
        lifted = is_lifted(states)
        running = left > 0
        reward = np.where(running & lifted, 1.0, 0.0)
        starts = (left < 0) & (lifted | (hand_height(states) >= self.raised[ids]))
        left = np.where(starts, COUNTDOWN, np.where(running, left - 1, left))
        self.step[ids], self.left[ids] = step, left
        terminated = has_fallen(states)
        truncated = ~terminated & ((left == 0) | (step >= self.last[ids]))
        return reward, terminated, truncated
