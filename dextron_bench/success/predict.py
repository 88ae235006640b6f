"""Predictions of the success model for every step of an episode."""

from __future__ import annotations

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions, expert_actions
from dextron_bench.experts.policies import Case
from dextron_bench.reaches.setting import Source
from dextron_bench.success.network import GRID, SuccessModel
from dextron_bench.world.model import CONTROL_STEP


def predict(model: SuccessModel, source: Source, case: Case, episode: Episode) -> StepPredictions:
    """What the model predicts at each step of an episode of a case, and what the case's expert would do there."""
    states = episode.states[:-1]
    chances = model.chance(states, episode.actions[:, 0])
    duration = source.duration(episode.setting) / CONTROL_STEP
    return StepPredictions(GRID, model.curve(states), chances, expert_actions(case.expert, states), duration)
