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
    """SAC that learns only from its own episodes (paper, fig. 4a, "RL")."""

    name: ClassVar[str] = "rl"

    def trainer(self, track: Track, seeds: Sequence[int]) -> Trainer:
        """A trainer with one SAC agent per seed, all trained together."""
        return Cycle(track, seeds, SCHEDULES[self.preset], self.demonstrated)

    def policy(self, weights: Mapping[str, np.ndarray]) -> MeanAgent:
        """The agent that plays the policy's mean."""
        return MeanAgent(weights)
