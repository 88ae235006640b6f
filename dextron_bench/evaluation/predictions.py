"""Predictions of the success model and actions of the expert for each step of an episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dextron_bench.experts import policies
from dextron_bench.experts.policies import Expert
from dextron_bench.world import task


@dataclass(frozen=True, slots=True)
class StepPredictions:
    """What a recording shows of an episode of T steps besides the episode's own arrays.

    `curves` (T, A) are the predicted probabilities of success of the actions `grid` (A,) from -1 to 1. `probabilities`
    (T,) are the predicted probabilities of success of the actions that the agent took. `expert_actions` (T,) are the
    actions of the setting's expert in the same states. `duration` is the length of the reach [control steps].
    """

    grid: np.ndarray
    curves: np.ndarray
    probabilities: np.ndarray
    expert_actions: np.ndarray
    duration: float


def expert_actions(expert: Expert, states: np.ndarray) -> np.ndarray:
    """The actions (T,) of an expert in consecutive states (T, 48) of an episode, from its first state on."""
    distances = task.distance(states)
    closing = policies.is_closing(distances, np.full(len(states), distances[0]), np.full(len(states), expert.critical))
    actions = policies.closing_speeds(task.closure(states), closing, np.full(len(states), expert.gain))[:, 0]
    actions[0] = 0.0
    return actions
