"""Finds episodes that show how the success model works: the five kinds of episodes in the paper's Fig. 5."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from dextron_bench.evaluation.diagnosis import Diagnosis, diagnose
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, ExpertAgent
from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.rows import Rows
from dextron_bench.success.network import SuccessModel
from dextron_bench.success.predict import predict
from dextron_bench.world.model import CONTROL_STEP

KINDS = {
    "fading": "wrong actions lower the chance",
    "early": "the hand closes too early",
    "expert": "correct for an expert",
    "policy": "correct for a policy",
    "wrong": "the model is wrong",
}
EXPERT = "expert"  # The player of an episode that no policy plays.
POSSIBLE = 0.6  # Success was possible in an episode if the best action had at least this chance at some step.
LOST = 0.2  # Success is no longer possible if even the best action has at most this chance.
RIGHT = 0.5  # The model is wrong about an episode if its accuracy is below this.
FALL_TIME = 0.25  # [s] in which the predicted chance falls when a hand closes too early.


@dataclass(frozen=True, slots=True)
class PredictedEpisode:
    """An episode with the model's predictions; `player` is "expert" or the name of the policy that plays it."""

    player: str
    episode: Episode
    diagnosis: Diagnosis
    predictions: StepPredictions

    @property
    def times(self) -> np.ndarray:
        """Time of each step (T,), as a share of the reach's duration."""
        return np.arange(len(self.predictions.probabilities)) / self.predictions.duration

    @property
    def correct(self) -> np.ndarray:
        """True for the steps (T,) at which the model predicts the outcome correctly."""
        return (self.predictions.probabilities > 0.5) == self.episode.success

    @property
    def accuracy(self) -> float:
        """Share of the steps at which the model predicts the outcome correctly."""
        return float(self.correct.mean())


def predict_episode(model: SuccessModel, source: Source, case: Case, player: str, episode: Episode) -> PredictedEpisode:
    """An episode of a case, with its diagnosis and the model's predictions for each step."""
    return PredictedEpisode(player, episode, diagnose(episode, case), predict(model, source, case, episode))


def play_and_predict(
    model: SuccessModel, source: Source, rows: Rows, policies: Mapping[str, Agent], threads: int = 0
) -> Iterator[PredictedEpisode]:
    """Plays experts and then each named policy on the same rows, and predicts every episode."""
    for player, agent in {EXPERT: ExpertAgent(), **policies}.items():
        episodes = dict(rollout(agent, source, rows, threads=threads))
        for row, case in enumerate(rows.cases):
            yield predict_episode(model, source, case, player, episodes[row])


def choose(episodes: Iterable[PredictedEpisode]) -> dict[str, PredictedEpisode]:
    """The clearest episode of each kind, in the order of KINDS; kinds without an episode are left out."""
    best: dict[str, tuple[float, PredictedEpisode]] = {}
    for episode in episodes:
        for kind, score in _clearness(episode).items():
            if kind not in best or score > best[kind][0]:
                best[kind] = score, episode
    return {kind: best[kind][1] for kind in KINDS if kind in best}


def _clearness(predicted: PredictedEpisode) -> dict[str, float]:
    """How clearly an episode shows its kind; empty if it is of no kind."""
    curves, chances = predicted.predictions.curves, predicted.predictions.probabilities
    is_policy, success = predicted.player != EXPERT, predicted.episode.success
    if is_policy and not success:  # An expert's mistake does not explain a policy.
        if predicted.diagnosis.cause == "too early":
            return {"early": _largest_fall(chances)}
        if (curves.max(axis=1) >= POSSIBLE).any() and curves[-1].max() <= LOST:
            return {"fading": predicted.accuracy * float((curves.max(axis=1) - chances).mean())}
    if predicted.accuracy < RIGHT:
        return {"wrong": 1.0 - predicted.accuracy}
    return {"policy" if is_policy else "expert": predicted.accuracy} if success else {}


def _largest_fall(chances: np.ndarray) -> float:
    """The largest fall of chances (T,) within FALL_TIME."""
    lag = min(int(FALL_TIME / CONTROL_STEP), len(chances) - 1)
    return float((chances[:-lag] - chances[lag:]).max()) if lag else 0.0
