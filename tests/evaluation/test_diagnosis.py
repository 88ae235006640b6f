"""Diagnosis: every cause from states made by hand, and the cause for experts with a wrong d_c."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from dextron_bench.evaluation import diagnosis
from dextron_bench.evaluation.diagnosis import closing_start, diagnose, expert_closing_start, first_touch
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.reaches.minjerk import MinjerkSource
from dextron_bench.reaches.reach import PALM_CENTRE
from dextron_bench.reaches.setting import Setting
from dextron_bench.world import model, task

SETTING = Setting("made-up", 0.0, 0.0, 0.0)
CASE = Case(SETTING, Expert(1.2, 0.251), 0.1)  # Closes at 0.1 m, in state 30 of APPROACH.
STEPS = 40
APPROACH = np.linspace(0.4, 0.0, STEPS + 1)  # [m] 0.01 m per step.
STANDS = np.full(STEPS + 1, 0.125)  # [m]
OPEN_FIRST = np.maximum(0.5 - 0.02 * np.arange(STEPS + 1), 0.2)


def states(
    distances: np.ndarray = APPROACH,
    closures: np.ndarray = OPEN_FIRST,
    heights: np.ndarray = STANDS,
    touched: int | None = 35,
) -> np.ndarray:
    """States (41, 48) with given distances, closures and bottle heights; the bottle moves in state `touched`."""
    arrays = np.zeros((STEPS + 1, model.STATE))
    arrays[:, 2] = heights
    if touched is not None:
        arrays[touched:, 1] = 0.003
    arrays[:, model.PALM_POSITION] = -PALM_CENTRE
    arrays[:, 7] -= np.sqrt(np.maximum(distances**2 - arrays[:, 1] ** 2, 0.0))
    arrays[:, model.PALM_QUATERNION] = arrays[:, model.BOTTLE_QUATERNION] = [1.0, 0.0, 0.0, 0.0]
    joints, closed = model.proximal()
    arrays[:, joints] = closures[:, None] * closed
    return arrays


def closing_from(start: int, rate: float = 0.03) -> np.ndarray:
    """Closures that fall to 0.2 and rise by `rate` per step after state `start`."""
    return OPEN_FIRST + rate * np.maximum(np.arange(STEPS + 1) - start, 0)


def episode(arrays: np.ndarray, score: int = 0, fell: bool = False, failure: str = "") -> Episode:
    rewards = np.zeros(STEPS)
    rewards[:score] = 1.0
    return Episode(SETTING, arrays, np.zeros((STEPS, 1)), rewards, fell, not fell, failure)


def cause(arrays: np.ndarray, score: int = 0, fell: bool = False, failure: str = "") -> str:
    return diagnose(episode(arrays, score, fell, failure), CASE).cause


def test_the_states_of_this_file_have_the_given_distances_and_closures():
    arrays = states(touched=None)
    np.testing.assert_allclose(task.distance(arrays), APPROACH, atol=1e-12)
    np.testing.assert_allclose(task.closure(arrays), OPEN_FIRST, atol=1e-12)


def test_the_hand_closes_at_the_start_of_the_largest_rise():
    assert closing_start(closing_from(28)) == 28
    assert closing_start(OPEN_FIRST) is None
    assert closing_start(np.array([0.5, 0.57, 0.5, 0.5])) is None  # Rises by 0.07.
    assert closing_start(np.array([0.5, 0.3, 0.31, 0.33, 0.5, 0.2, 0.3])) == 2  # The rise of 0.2, once past 0.32.


def lag(closures: np.ndarray, critical: float = 0.251, distances: np.ndarray = APPROACH) -> float:
    case = replace(CASE, expert=Expert(1.2, critical))
    return diagnose(episode(states(distances, closures)), case).closing_lag


def test_the_lag_counts_from_the_state_in_which_the_expert_would_close():
    assert lag(closing_from(33)) == pytest.approx(0.06)
    assert lag(closing_from(20)) == pytest.approx(-0.20)
    assert np.isnan(lag(OPEN_FIRST))


def test_every_expert_closes_within_3_cm():
    assert lag(closing_from(30), critical=0.0) == pytest.approx(-8 * 0.02)  # The distance is 0.02 m in state 38.


def test_the_end_of_the_episode_replaces_the_time_of_an_expert_that_never_closes():
    assert expert_closing_start(np.maximum(APPROACH, 0.2), 0.251) is None
    assert lag(closing_from(25), distances=np.maximum(APPROACH, 0.2)) == pytest.approx(-15 * 0.02)


def test_the_expert_never_closes_in_the_first_state():
    assert expert_closing_start(APPROACH, 1.1) == 1


def test_first_touch():
    assert first_touch(states(touched=35)) == 35
    assert first_touch(states(touched=None)) is None


def test_solved_episodes_and_failed_agents():
    assert cause(states(), score=20) == "solved"
    assert cause(states(), score=20, failure="action is nan at step 40") == "agent failed"


def test_an_agent_that_fails_at_once_is_diagnosed():
    empty = Episode(SETTING, states()[:1], np.zeros((0, 1)), np.zeros(0), False, False, "action is nan at step 0")
    diagnosed = diagnose(empty, CASE)
    assert diagnosed.cause == "agent failed"
    assert np.isnan(diagnosed.closing_lag)


@pytest.mark.parametrize(
    ("start", "fell", "expected"),
    [
        (29, True, "too early"),
        (29, False, "too early"),
        (31, True, "knocked over"),
        (31, False, "slipped"),
        (36, True, "knocked over"),  # 6 steps late, the largest lag of experts.
        (37, True, "too late"),
        (37, False, "too late"),
    ],
)
def test_the_time_of_closing_decides_the_cause(start: int, fell: bool, expected: str):
    assert cause(states(closures=closing_from(start, 0.1)), fell=fell) == expected


def test_a_hand_that_never_opened_knocks_the_bottle_over():
    half_closed = np.full(STEPS + 1, 0.5)
    assert cause(states(closures=half_closed), fell=True) == "knocked over"
    assert cause(states(closures=OPEN_FIRST), fell=True) == "too late"
    assert cause(states(closures=half_closed)) == "too late"


def test_a_bottle_that_fell_before_the_expert_closes_is_knocked_over():
    assert cause(states(np.maximum(APPROACH, 0.11)), fell=True) == "knocked over"
    assert cause(states(np.maximum(APPROACH, 0.09)), fell=True) == "too late"


def test_a_raised_bottle_slipped_or_was_raised_too_late():
    up = STANDS + 0.01 * np.maximum(np.arange(STEPS + 1) - 25, 0)  # Up to 0.275 m.
    down = np.where(np.arange(STEPS + 1) < 38, up, 0.2)
    assert cause(states(heights=up, closures=closing_from(31)), score=8) == "too late"
    assert cause(states(heights=up, closures=closing_from(20)), score=8) == "too early"
    for start in (20, 31):
        assert cause(states(heights=down, closures=closing_from(start)), score=8) == "slipped"
        assert cause(states(heights=down, closures=closing_from(start)), score=8, fell=True) == "slipped"


def test_never_reached_needs_a_bottle_that_did_not_move():
    aside = np.maximum(APPROACH, 0.061)
    assert cause(states(aside, touched=None)) == "never reached"
    assert cause(states(aside, touched=35)) == "too late"
    assert cause(states(np.maximum(APPROACH, 0.059), touched=None)) == "too late"


def test_the_table_counts_episodes_by_method_and_cause():
    rows = pd.DataFrame(
        [("exp", "solved"), ("exp", "solved"), ("bc", "slipped"), ("bc", "solved")], columns=["method", "cause"]
    )
    counts = diagnosis.cause_table(rows)
    assert counts.columns.tolist() == list(diagnosis.CAUSES)
    assert counts.index.tolist() == ["bc", "exp"]
    assert counts.to_numpy().tolist() == [[1, 0, 0, 0, 1, 0, 0], [2, 0, 0, 0, 0, 0, 0]]


def test_an_expert_with_a_large_critical_distance_closes_too_early():
    source = MinjerkSource()
    right = Case(Setting("minjerk-000007", 0.0, 0.0, 0.0), Expert(2.0, 0.15), 0.1)
    played = {
        critical: next(
            rollout(ExpertAgent(), source, [replace(right, expert=Expert(2.0, critical))], slots=1, threads=1)
        )[1]
        for critical in (0.15, 0.9)
    }
    solved = diagnose(played[0.15], right)
    assert solved.cause == "solved"
    assert solved.closing_lag == pytest.approx(0.04, abs=0.03)
    early = diagnose(played[0.9], right)
    assert early.cause == "too early"
    assert early.closing_lag < -0.5
