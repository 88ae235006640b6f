"""The experts Pi_E of the paper: the hand closes when it is within a critical distance (Eq. 1 and 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dextron_bench.world import task

if TYPE_CHECKING:  # The process of an isolated agent imports this module, and may not import settings.
    from dextron_bench.reaches.setting import Setting

GAIN = (1.0, 1.5)  # K, drawn uniformly (table I).
CRITICAL_DISTANCE = (0.01, 0.90)  # d_c, as a fraction of the first distance, drawn uniformly (table I).
OPEN, CLOSED = 0.0, 0.8  # Reference closures of the two phases.
ALWAYS_CLOSE = 0.03  # [m] distance within which every expert closes.


@dataclass(frozen=True, slots=True)
class Expert:
    """One policy of Pi_E: gain K and critical normalised distance d_c."""

    gain: float
    critical: float


@dataclass(frozen=True, slots=True)
class Case:
    """One row of a split: a setting, an expert for it, and the width of the range of d_c that succeeds there."""

    setting: Setting
    expert: Expert
    window: float


def is_closing(distances: np.ndarray, first: np.ndarray, critical: np.ndarray) -> np.ndarray:
    """True if an expert is in its closing phase, for distances [m], first distances [m] and d_c, each (N,)."""
    return (distances / first < critical) | (distances < ALWAYS_CLOSE)


def closing_speeds(closures: np.ndarray, closing: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Closing speeds (N, 1) in [-1, 1] by Eq. 1, for closures, closing phase (True or False) and gain K, each (N,)."""
    target = np.where(closing, CLOSED, OPEN)
    return np.clip(gain * (target - closures), -1.0, 1.0)[:, None]


class ExpertAgent:
    """Plays each episode's expert, which `assign` sets.

    The first action of an episode is 0. Later distances are divided by the distance at that first step.
    """

    rows_are_independent = True

    def __init__(self) -> None:
        self._gain, self._critical, self._first = np.zeros((3, 0))

    def assign(self, episodes: np.ndarray, experts: Sequence[Expert]) -> None:
        """Sets the experts that rows `episodes` (n,) play from their next `reset` on."""
        self._grow(int(episodes.max()) + 1)
        self._gain[episodes] = [expert.gain for expert in experts]
        self._critical[episodes] = [expert.critical for expert in experts]

    def reset(self, episodes: np.ndarray) -> None:
        """Forgets the first distance of rows `episodes` (n,), which begin a new episode."""
        self._first[episodes] = np.nan

    def act(self, states: np.ndarray) -> np.ndarray:
        """Closing speeds (N, 1) for states (N, 48)."""
        self._grow(len(states))
        distances = task.distance(states)
        first_step = np.isnan(self._first)
        self._first = np.where(first_step, distances, self._first)
        closing = is_closing(distances, self._first, self._critical)
        actions = closing_speeds(task.closure(states), closing, self._gain)
        actions[first_step] = 0.0
        return actions

    def _grow(self, n: int) -> None:
        missing = n - len(self._first)
        if missing > 0:
            self._gain, self._critical = (np.pad(a, (0, missing)) for a in (self._gain, self._critical))
            self._first = np.pad(self._first, (0, missing), constant_values=np.nan)
