"""Which episodes are chosen to explain a success model, and the picture of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dextron_bench.evaluation.diagnosis import Diagnosis
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.reaches.setting import Setting
from dextron_bench.scores.figures import pictures
from dextron_bench.scores.figures.episodes import ridges
from dextron_bench.success.exemplars import KINDS, PredictedEpisode, choose
from dextron_bench.success.network import GRID


def predicted(player: str, cause: str, best: list[float], taken: list[float]) -> PredictedEpisode:
    """An episode with one step for each entry: the chances of the best action, and of the taken action, which is 0."""
    steps = len(taken)
    curves = np.tile(np.array(taken)[:, None], 51)
    curves[:, -1] = best
    rewards = np.full(steps, 20.0 / steps if cause == "solved" else 0.0)
    episode = Episode(Setting("a", 0, 0, 0), np.zeros((steps + 1, 48)), np.zeros((steps, 1)), rewards, False, True)
    predictions = StepPredictions(GRID, curves, np.array(taken), np.zeros(steps), duration=steps)
    return PredictedEpisode(player, episode, Diagnosis(cause, 0.0), predictions)


EXPERT = predicted("expert", "solved", [0.9, 0.9], [0.8, 0.9])
POLICY = predicted("p", "solved", [0.9, 0.9], [0.4, 0.9])
EARLY = predicted("p", "too early", [0.9] * 20, [0.9] * 10 + [0.1] * 10)
FADING = predicted("p", "too late", [0.8, 0.7, 0.1, 0.1], [0.3, 0.2, 0.1, 0.1])
WRONG = predicted("p", "too late", [0.9, 0.9], [0.9, 0.9])


def test_each_kind_gets_its_episode():
    chosen = choose([WRONG, FADING, EARLY, POLICY, EXPERT])
    assert list(chosen) == list(KINDS)
    assert [chosen[kind] for kind in KINDS] == [FADING, EARLY, EXPERT, POLICY, WRONG]


def test_the_clearest_episode_is_chosen_and_kinds_without_an_episode_are_left_out():
    unclear = predicted("expert", "solved", [0.9, 0.9], [0.4, 0.4])
    assert choose([unclear, EXPERT]) == {"expert": EXPERT, "wrong": unclear}
    failed = predicted("expert", "too early", [0.9] * 20, [0.9] * 11 + [0.1] * 9)
    assert choose([failed]) == {"wrong": failed}  # An expert's mistake does not explain a policy.


def test_an_episode_has_one_kind_at_most_and_a_mostly_correct_model_is_not_wrong():
    early = predicted("p", "too early", [0.9] * 20, [0.9] * 15 + [0.1] * 5)  # With an accuracy of 1/4.
    assert choose([early]) == {"early": early}
    mostly_correct = predicted("p", "too late", [0.9] * 3, [0.9, 0.1, 0.1])
    assert choose([mostly_correct]) == {}


def test_a_step_is_correct_if_the_model_predicts_the_outcome():
    assert POLICY.correct.tolist() == [False, True]
    assert FADING.accuracy == 1.0
    assert WRONG.accuracy == 0.0


def test_the_picture_is_drawn_for_episodes_of_any_length(tmp_path: Path):
    long = predicted("p", "solved", [0.9] * 200, list(np.linspace(0, 1, 200)))
    ridges({"one": EXPERT, "two": long}, tmp_path / "ridges.png")
    assert (tmp_path / "ridges.png").stat().st_size > 10_000
    with pytest.raises(pictures.UnknownFormat):
        ridges({"one": EXPERT}, tmp_path / "ridges.txt")
    assert len(GRID) == EXPERT.predictions.curves.shape[1]
