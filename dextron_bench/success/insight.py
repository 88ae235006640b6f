"""What is known of an episode beside what happened: how hopeful its actions were, and what its expert would do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dextron_bench import experts
from dextron_bench.experts import Expert
from dextron_bench.rollout import Case, Episode
from dextron_bench.success.network import SuccessModel
from dextron_bench.world import model as world
from dextron_bench.world import task
from dextron_bench.world.setting import Source


@dataclass(frozen=True, slots=True)
class Insight:
    """What a recording shows of an episode of T steps besides its own arrays.

    `curves` (T, A) are the chances of success of A actions evenly from -1 to 1, `chances` (T,) those of the actions
    taken, `experts` (T,) the actions that the setting's expert would have taken in the same states, and `duration`
    the length of the reach [steps].
    """

    curves: np.ndarray
    chances: np.ndarray
    experts: np.ndarray
    duration: float


def look(model: SuccessModel, source: Source, case: Case, episode: Episode) -> Insight:
    """The insight that a success model gives into an episode of a case."""
    before = episode.states[:-1]
    chances = model.chance(before, episode.actions[:, 0])
    duration = source.duration(episode.setting) / world.CONTROL_STEP
    return Insight(model.curve(before), chances, expert_actions(case.expert, before), duration)


def expert_actions(expert: Expert, states: np.ndarray) -> np.ndarray:
    """What an expert would have done (T,) in states (T, 48) that came one after the other."""
    distances = task.distance(states)
    closing = experts.closes(distances, np.full(len(states), distances[0]), np.full(len(states), expert.critical))
    actions = experts.law(task.closure(states), closing, np.full(len(states), expert.gain))[:, 0]
    actions[0] = 0.0
    return actions
