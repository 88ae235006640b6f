"""Phases of episodes, with states made by hand: closures, heights of the bottle, heights of the hand."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dextron_bench.evaluation import diagnosis
from dextron_bench.evaluation.phases import PHASES, countdown_start, phases, turning_points
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.reaches.setting import Setting
from dextron_bench.world import model, task
from tests.helpers import tiny_benchmark
from tests.helpers.short_reaches import SOURCE


def states(closures: list[float], bottle: list[float] | None = None, hand: list[float] | None = None) -> np.ndarray:
    """States (T, 48) with these closures of all digits, heights of the bottle's centre and of the hand [m]."""
    made = np.tile(np.concatenate([model.initial_qpos(), np.zeros(23)]), (len(closures), 1))
    joints, closed = model.proximal()
    made[:, joints] = np.array(closures)[:, None] * closed
    made[:, 2] = bottle or 0.125
    made[:, 9] = hand or 0.1
    return made


def names(played: np.ndarray, actions: list[float] | None = None) -> list[tuple[str, int]]:
    """The phases of states and their numbers of states, in order; by default an action has the sign of the movement."""
    signs = np.sign(np.diff(task.closure(played))) if actions is None else np.array(actions)
    return [(PHASES[place], len(list(group))) for place, group in groupby(phases(played, signs[:, None]))]


def test_a_hand_that_rests_only_reaches() -> None:
    assert names(states([0.5] * 7)) == [("reach", 7)]


def test_a_hand_opens_then_waits_then_closes_and_stays_closed() -> None:
    """0.02 above the lowest closure counts as open, and the last state before the rise as its beginning."""
    closures = [0.5, 0.4, 0.3, 0.2, 0.1, 0.01, 0.0, 0.0, 0.0, 0.1, 0.3, 0.5, 0.5]
    assert names(states(closures)) == [("open", 5), ("reach", 3), ("close", 5)]


def test_a_small_movement_is_none() -> None:
    assert names(states([0.5, 0.43, 0.5, 0.57])) == [("reach", 1), ("close", 3)]  # 0.14 from the lowest on.
    assert names(states([0.5, 0.43, 0.5, 0.43])) == [("reach", 4)]


def test_fingers_that_the_bottle_pushes_open_stay_closed() -> None:
    closures = [0.0, 0.2, 0.4, 0.3, 0.2, 0.4]
    assert names(states(closures), [1.0] * 5) == [("close", 6)]
    assert names(states(closures), [1.0, 1.0, -1.0, -1.0, 1.0]) == [("close", 2), ("open", 2), ("close", 2)]


def test_lift_from_15_cm_and_countdown_from_25_cm() -> None:
    bottle = [0.125, 0.149, 0.15, 0.2, 0.24, 0.25, 0.3, 0.2]
    assert names(states([0.0] * 8, bottle)) == [("reach", 2), ("lift", 3), ("countdown", 3)]
    assert names(states([0.0] * 4, [0.125, 0.2, 0.14, 0.125])) == [("reach", 1), ("lift", 1), ("reach", 2)]


def test_the_countdown_starts_without_the_bottle_when_the_hand_has_risen() -> None:
    hand = [0.1, 0.2, 0.244, 0.246, 0.2]
    assert names(states([0.5] * 5, hand=hand)) == [("reach", 3), ("countdown", 2)]
    assert countdown_start(states([0.5] * 5)) == 5


def test_the_countdown_is_the_one_of_the_task() -> None:
    """A solved episode ends 20 states after the countdown has started, and has all five phases in order."""
    reach, x, y, noise, gain, critical, window = tiny_benchmark.SOLVED[0]
    case = Case(Setting(reach, x, y, noise), Expert(gain, critical), window)
    ((_, episode),) = rollout(ExpertAgent(), SOURCE, [case], threads=1)
    assert len(episode.states) - 1 - countdown_start(episode.states) == task.COUNTDOWN == episode.score
    places = phases(episode.states, episode.actions)
    assert [PHASES[place] for place, _ in groupby(places)] == ["open", "reach", "close", "lift", "countdown"]
    assert np.argmax(places == PHASES.index("close")) == diagnosis.closing_start(task.closure(episode.states))


def test_turning_points_by_hand() -> None:
    assert turning_points(np.array([0.2, 0.1, 0.15, 0.3, 0.25, 0.3, 0.1, 0.0])) == [0, 1, 3, 7]
    assert turning_points(np.array([0.2, 0.15, 0.2])) == []


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=60))
def test_turning_points_alternate_and_the_largest_rise_is_among_their_movements(values: list[float]) -> None:
    closures = np.array(values)
    points = turning_points(closures)
    steps = np.diff(closures[points]) if points else np.array([])
    assert np.all(np.abs(steps) >= diagnosis.CLOSED - 1e-12)
    assert np.all(np.sign(steps[1:]) == -np.sign(steps[:-1]))
    assert points == sorted(set(points))
    rises = diagnosis.closing_start(closures) is not None
    assert rises == bool(np.any(steps > 0.0))


@given(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=60), st.floats(-1.0, 1.0))
def test_every_state_has_a_phase_and_only_an_opening_agent_opens(values: list[float], action: float) -> None:
    places = phases(states(values), np.full((len(values) - 1, 1), action))
    assert places.shape == (len(values),)
    assert set(places) <= set(range(len(PHASES)))
    assert action < 0.0 or PHASES.index("open") not in places
