"""What the success model thinks while an episode runs, and the five kinds of episodes that the paper shows (Fig. 5)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dextron_bench.evaluation.diagnosis import Diagnosis, diagnose
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, ExpertAgent
from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Source
from dextron_bench.success.network import SuccessModel
from dextron_bench.success.predict import predict
from dextron_bench.world import model as world_model

KINDS = {
    "fading": "hope that fades by wrong actions",
    "early": "a closing that came too early",
    "expert": "right for an expert",
    "policy": "right for a policy",
    "wrong": "the model is wrong",
}
EXPERT = "expert"  # Who acts where it is no policy.
OPEN = 0.6  # A window of hope is open where the best action has this chance at least.
RIGHT = 0.5  # A model that is right at fewer of the steps was wrong about the episode.
SHUT = 0.2  # It is shut where even the best has this chance at most.


@dataclass(frozen=True, slots=True)
class PredictedEpisode:
    """An episode as the model foretells it; `player` says who acts, "expert" or a policy's name."""

    player: str
    episode: Episode
    diagnosis: Diagnosis
    predictions: StepPredictions

    @property
    def times(self) -> np.ndarray:
        """When each step (T,) is, as a share of the reach's duration."""
        return np.arange(len(self.predictions.chances)) / self.predictions.duration

    @property
    def correct(self) -> np.ndarray:
        """True for the steps (T,) at which the outcome is foretold."""
        return (self.predictions.chances > 0.5) == self.episode.success

    @property
    def accuracy(self) -> float:
        """The share of steps at which the outcome is foretold."""
        return float(self.correct.mean())


def predict_episode(model: SuccessModel, source: Source, case: Case, player: str, episode: Episode) -> PredictedEpisode:
    """What the model thinks at each step of an episode of a case."""
    return PredictedEpisode(player, episode, diagnose(episode, case), predict(model, source, case, episode))


def play_and_predict(
    model: SuccessModel, source: Source, cases: Sequence[Case], policies: Mapping[str, Agent], threads: int = 0
) -> Iterator[PredictedEpisode]:
    """Episodes of experts and of named policies on the same cases, as the model foretells them."""
    for player, agent in {EXPERT: ExpertAgent(), **policies}.items():
        played = dict(rollout(agent, source, cases, threads=threads))
        for row, case in enumerate(cases):
            yield predict_episode(model, source, case, player, played[row])


def choose(seen: Iterable[PredictedEpisode]) -> dict[str, PredictedEpisode]:
    """The clearest episode of each of KINDS, those left out of which there is none."""
    best: dict[str, tuple[float, PredictedEpisode]] = {}
    for each in seen:
        for kind, score in _scores(each).items():
            if kind not in best or score > best[kind][0]:
                best[kind] = score, each
    return {kind: best[kind][1] for kind in KINDS if kind in best}


def _scores(seen: PredictedEpisode) -> dict[str, float]:
    """How clear an episode is as the kind that it is, if it is any."""
    own, curves, chances = seen.player != EXPERT, seen.predictions.curves, seen.predictions.chances
    if own and not seen.episode.success:  # What experts do wrong explains no policy.
        if seen.diagnosis.cause == "too early":
            return {"early": _fall(chances)}
        if (curves.max(axis=1) >= OPEN).any() and curves[-1].max() <= SHUT:
            return {"fading": seen.accuracy * float((curves.max(axis=1) - chances).mean())}
    if seen.accuracy < RIGHT:
        return {"wrong": 1.0 - seen.accuracy}
    return {"policy" if own else "expert": seen.accuracy} if seen.episode.success else {}


def _fall(chances: np.ndarray) -> float:
    """The largest drop of chances (T,) within a quarter of a second."""
    lag = min(int(0.25 / world_model.CONTROL_STEP), len(chances) - 1)
    return float((chances[:-lag] - chances[lag:]).max()) if lag else 0.0
