"""What a model predicts of an episode, and what its expert would do, beside what happened."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dextron_bench.experts import policies
from dextron_bench.experts.policies import Expert
from dextron_bench.world import task


@dataclass(frozen=True, slots=True)
class StepPredictions:
    """What a recording shows of an episode of T steps besides its own arrays.

    `curves` (T, A) are the chances of success of the actions `grid` (A,) from -1 to 1. `chances` (T,) are the chances
    of the actions that the agent took. `experts` (T,) are the actions that the setting's expert would have taken in
    the same states. `duration` is the length of the reach [steps].
    """

    grid: np.ndarray
    curves: np.ndarray
    chances: np.ndarray
    experts: np.ndarray
    duration: float


def expert_actions(expert: Expert, states: np.ndarray) -> np.ndarray:
    """What an expert would have done (T,) in states (T, 48) that came one after the other."""
    distances = task.distance(states)
    closing = policies.is_closing(distances, np.full(len(states), distances[0]), np.full(len(states), expert.critical))
    actions = policies.closing_speeds(task.closure(states), closing, np.full(len(states), expert.gain))[:, 0]
    actions[0] = 0.0
    return actions
