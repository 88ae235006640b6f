"""Which episodes explain a success model, and how they are drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dextron_bench.evaluation.diagnosis import Diagnosis
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.reaches.setting import Setting
from dextron_bench.scores import figures
from dextron_bench.success.exemplars import KINDS, PredictedEpisode, choose
from dextron_bench.success.network import GRID


def seen(player: str, cause: str, best: list[float], own: list[float]) -> PredictedEpisode:
    """An episode of as many steps, in each of which the best action and the chosen one, 0, have these chances."""
    steps = len(own)
    curves = np.tile(np.array(own)[:, None], 51)
    curves[:, -1] = best
    rewards = np.full(steps, 20.0 / steps if cause == "solved" else 0.0)
    episode = Episode(Setting("a", 0, 0, 0), np.zeros((steps + 1, 48)), np.zeros((steps, 1)), rewards, False, True)
    predictions = StepPredictions(GRID, curves, np.array(own), np.zeros(steps), duration=steps)
    return PredictedEpisode(player, episode, Diagnosis(cause, 0.0), predictions)


EXPERT = seen("expert", "solved", [0.9, 0.9], [0.8, 0.9])
POLICY = seen("p", "solved", [0.9, 0.9], [0.4, 0.9])
EARLY = seen("p", "too early", [0.9] * 20, [0.9] * 10 + [0.1] * 10)
FADING = seen("p", "too late", [0.8, 0.7, 0.1, 0.1], [0.3, 0.2, 0.1, 0.1])
WRONG = seen("p", "too late", [0.9, 0.9], [0.9, 0.9])


def test_each_kind_finds_its_own():
    found = choose([WRONG, FADING, EARLY, POLICY, EXPERT])
    assert list(found) == list(KINDS)
    assert [found[kind] for kind in KINDS] == [FADING, EARLY, EXPERT, POLICY, WRONG]


def test_the_clearer_episode_is_chosen_and_kinds_there_are_none_of_are_left_out():
    dull = seen("expert", "solved", [0.9, 0.9], [0.4, 0.4])
    assert choose([dull, EXPERT]) == {"expert": EXPERT, "wrong": dull}
    failed = seen("expert", "too early", [0.9] * 20, [0.9] * 11 + [0.1] * 9)
    assert choose([failed]) == {"wrong": failed}  # What experts do wrong explains no policy.


def test_an_episode_is_of_one_kind_and_a_model_that_is_mostly_right_is_not_wrong():
    early = seen("p", "too early", [0.9] * 20, [0.9] * 15 + [0.1] * 5)  # Also foretold at a quarter of its steps.
    assert choose([early]) == {"early": early}
    mostly = seen("p", "too late", [0.9] * 3, [0.9, 0.1, 0.1])
    assert choose([mostly]) == {}


def test_a_step_is_right_where_the_outcome_is_foretold():
    assert POLICY.correct.tolist() == [False, True]
    assert FADING.accuracy == 1.0
    assert WRONG.accuracy == 0.0


def test_the_picture_is_drawn_whatever_the_length(tmp_path: Path):
    long = seen("p", "solved", [0.9] * 200, list(np.linspace(0, 1, 200)))
    figures.ridges({"one": EXPERT, "two": long}, tmp_path / "ridges.png")
    assert (tmp_path / "ridges.png").stat().st_size > 10_000
    with pytest.raises(figures.UnknownFormat):
        figures.ridges({"one": EXPERT}, tmp_path / "ridges.txt")
    assert len(GRID) == EXPERT.predictions.curves.shape[1]
