"""RL: soft actor-critic without demonstrations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from baselines.cycle import Cycle
from baselines.policy import MeanAgent
from baselines.schedule import SCHEDULES, Scheduled
from dextron_bench import Track, Trainer


@dataclass(frozen=True)
class Rl(Scheduled):
    """SAC that learns from its own episodes alone (paper, fig. 4a, "RL")."""

    name: ClassVar[str] = "rl"

    def trainer(self, track: Track, seeds: Sequence[int]) -> Trainer:
        """One SAC agent a seed, side by side."""
        return Cycle(track, seeds, SCHEDULES[self.preset], self.demonstrated)

    def policy(self, weights: Mapping[str, np.ndarray]) -> MeanAgent:
        """Plays the policy's mean."""
        return MeanAgent(weights)
