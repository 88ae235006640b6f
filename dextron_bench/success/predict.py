"""What is known of an episode beside what happened: how hopeful its actions were, and what its expert would do."""

from __future__ import annotations

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions, expert_actions
from dextron_bench.experts.policies import Case
from dextron_bench.reaches.setting import Source
from dextron_bench.success.network import GRID, SuccessModel
from dextron_bench.world import model as world_model


def predict(model: SuccessModel, source: Source, case: Case, episode: Episode) -> StepPredictions:
    """The insight that a success model gives into an episode of a case."""
    before = episode.states[:-1]
    chances = model.chance(before, episode.actions[:, 0])
    duration = source.duration(episode.setting) / world_model.CONTROL_STEP
    return StepPredictions(GRID, model.curve(before), chances, expert_actions(case.expert, before), duration)
