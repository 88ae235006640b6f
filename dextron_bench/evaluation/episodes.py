"""Episodes: the arrays of one rollout, and hashes that identify them.

Equal settings and equal actions give equal bits, so comparing one hash is enough to compare two episodes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from dextron_bench.reaches.setting import Setting
from dextron_bench.storage import hashing
from dextron_bench.world import task

SHORT = 12  # Hexadecimal digits of each hash of actions in a result.


@dataclass(frozen=True, slots=True)
class Episode:
    """One rollout: states (T + 1, 48), actions (T, 1), rewards (T,), float64, and how it ended.

    `failure` is empty, or says what the agent did wrong or that the simulation diverged; an episode with a failure ends
    before that step and scores 0.
    """

    setting: Setting
    states: np.ndarray
    actions: np.ndarray
    rewards: np.ndarray
    terminated: bool
    truncated: bool
    failure: str = ""

    @property
    def score(self) -> float:
        """Sum of rewards, 0 to 20."""
        return 0.0 if self.failure else float(self.rewards.sum())

    @property
    def success(self) -> bool:
        """True if the bottle was held up for the whole countdown."""
        return self.score == task.SUCCESS


def fingerprint(episode: Episode) -> str:
    """SHA-256 over all states, actions and rewards, hexadecimal."""
    arrays = (episode.states, episode.actions, episode.rewards)
    return hashing.digest(*(np.ascontiguousarray(array, "<f8").tobytes() for array in arrays))


def action_hashes(actions: Iterable[np.ndarray]) -> list[str]:
    """The first SHORT digits of the hash of each episode's actions (T,); copied episodes have equal hashes."""
    return [hashing.digest(np.ascontiguousarray(array, "<f8").tobytes())[:SHORT] for array in actions]
