"""Windows of closing, and when an agent begins to close: by hand, and against an agent that closes at a known step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from baselines.reflex import Reflex
from dextron_bench.evaluation import closing_windows
from dextron_bench.evaluation.closing_windows import Choice
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.openings import FAILS, NO_DECISION, SUCCEEDS
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.splits.rows import Rows
from dextron_bench.world import model, task
from dextron_bench.world.bottles import model_bottle
from tests.helpers.short_reaches import SETTINGS, SOURCE

CASE = Case(SETTINGS[0], Expert(1.2, 0.3), 0.1)
ROW = Rows(cases=(CASE,))
HEAVY = replace(model_bottle(), mass=5.0)


def episode(monkeypatch: pytest.MonkeyPatch, closures: list[float], actions: list[float], score: float) -> Episode:
    """An episode whose states have these closures."""
    monkeypatch.setattr(task, "closure", lambda states: states[:, 0])
    states = np.zeros((len(closures), model.STATE))
    states[:, 0] = closures
    rewards = np.zeros(len(actions))
    rewards[-1] = score
    return Episode(CASE.setting, states, np.array(actions)[:, None], rewards, terminated=False, truncated=True)


def test_the_window_of_an_opening_by_hand():
    outcomes = np.array([NO_DECISION, NO_DECISION, FAILS, NO_DECISION, SUCCEEDS, NO_DECISION, FAILS], np.int8)
    window = closing_windows._window(outcomes)
    np.testing.assert_allclose(window.times, [0.04, 0.08, 0.12])
    assert window.works.tolist() == [False, True, False]
    never_near = closing_windows._window(outcomes[:2])
    assert never_near.times.size == never_near.works.size == 0


@pytest.mark.parametrize(
    ("closures", "actions", "step"),
    [
        ([0.5, 0.3, 0.1, 0.09, 0.3, 0.6], [-1, -1, 1, 1, 1], 2),  # The hand still opens after the first closing action.
        ([0.5, 0.5, 0.5, 0.6, 0.7, 0.8], [0, 0.2, 0.2, 0.2, 0.2], 1),
        (
            [0.5, 0.3, 0.3, 0.4, 0.6, 0.8],
            [1, -1, -1, -1, -1],
            2,
        ),  # It rises against its actions: where the rise starts.
        ([0.5, 0.6, 0.7, 0.8, 0.8, 0.8], [1, 1, 1, 1, 1], 0),
    ],
)
def test_a_choice_is_the_first_of_the_actions_that_make_the_hand_close(
    monkeypatch: pytest.MonkeyPatch, closures: list[float], actions: list[float], step: int
):
    assert closing_windows.choice(episode(monkeypatch, closures, actions, 20.0)) == Choice(step * 0.02, True)


def test_a_hand_that_never_closes_has_no_choice(monkeypatch: pytest.MonkeyPatch):
    choice = closing_windows.choice(episode(monkeypatch, [0.5, 0.4, 0.3], [-1, -1], 3.0))
    assert np.isnan(choice.time)
    assert not choice.success


@pytest.mark.slow
@pytest.mark.parametrize("row", [ROW, replace(ROW, bottles=(HEAVY,))], ids=["plain", "heavy"])
def test_the_choice_of_an_agent_that_closes_once_is_its_first_closing_action_and_its_window_predicts_it(row: Rows):
    """`reflex` opens and closes at full speed, as a fork does, so the window says how its episode ends."""
    window = closing_windows.play_windows(SOURCE, row, threads=1)[0]
    for near in (0.065, 0.15):
        choice = closing_windows.play_choices(Reflex(near).agent(0), SOURCE, row, threads=1)[0]
        ((_, played),) = rollout(Reflex(near).agent(0), SOURCE, row, threads=1)
        assert choice.time == pytest.approx(0.02 * int(np.argmax(played.actions[:, 0] > 0.0)))
        nearest = int(np.argmin(np.abs(window.times - choice.time)))
        if abs(window.times[nearest] - choice.time) < 0.01:
            assert choice.success == window.works[nearest]
    assert window.works.any() == (row is ROW)  # A hand cannot hold a bottle of 5 kg.
