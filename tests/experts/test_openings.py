"""Openings: when closing works, compared with episodes that close there, and which decisions are tried."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import openings
from dextron_bench.experts.openings import FAILS, NO_DECISION, SUCCEEDS, Openings
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.world import task
from dextron_bench.world.engine import Engine, Step
from tests.helpers.short_reaches import SETTINGS, SOURCE

CASES = [Case(setting, Expert(1.2, 0.3), 0.1) for setting in SETTINGS]


class ClosesAt:
    """Opens until a step, then closes at full speed."""

    def __init__(self, step: int) -> None:
        self._closing_step, self._step = step, -1

    def reset(self, episodes: np.ndarray) -> None:
        """Rows begin a new episode; all begin together."""
        self._step = -1

    def act(self, states: np.ndarray) -> np.ndarray:
        """Actions (N, 1), -1 or 1."""
        self._step += 1
        return np.full((len(states), 1), 1.0 if self._step >= self._closing_step else -1.0)


@pytest.fixture(scope="module")
def played() -> Openings:
    """The openings of the five short settings."""
    return openings.joined(openings.play(SOURCE, SETTINGS, threads=1))


@pytest.mark.slow
def test_an_outcome_is_the_end_of_an_episode_that_closes_there(played: Openings):
    """All decisions that were tried are played again, each from its start by an agent that closes at that step."""
    for number in (0, 1):
        outcomes = played.outcomes[played.rows(number)]
        steps = np.flatnonzero(outcomes != NO_DECISION)
        tried = steps[:: openings.FIRST_TRIED]
        scores = [dict(rollout(ClosesAt(step), SOURCE, [CASES[number]], 1, 1))[0].score for step in tried]
        assert [score == task.SUCCESS for score in scores] == (outcomes[tried] == SUCCEEDS).tolist()
    assert set(played.outcomes) == {NO_DECISION, FAILS, SUCCEEDS}


@pytest.mark.slow
def test_decisions_begin_near_the_bottle_and_come_every_second_step(played: Openings):
    for number in range(len(played)):
        rows = played.rows(number)
        steps = np.flatnonzero(played.outcomes[rows] != NO_DECISION)
        distances = task.distance(played.states[rows].astype(float))
        assert steps[0] == np.argmax(distances < openings.NEAR)
        assert set(np.diff(steps)) == {openings.EVERY}


class Walks:
    """An engine of one slot whose hand walks through given distances; its states are numbers."""

    def __init__(self, distances: list[float]) -> None:
        self._left = iter(distances)

    def begin(self, slots: np.ndarray, *_: object) -> np.ndarray:
        """The first state."""
        return np.array([[next(self._left)]])

    def save(self, slots: np.ndarray) -> dict[str, np.ndarray]:
        """Nothing of an engine's state but its slots."""
        return {"slot": slots}

    def step(self, slots: np.ndarray, actions: np.ndarray) -> Step:
        """The next state; the episode ends when no distance is left."""
        distance = next(self._left, None)
        ended = np.array([distance is None])
        return Step(np.array([[distance or 0.0]]), np.zeros(1), ended, ended, ended)


def test_decisions_are_counted_from_the_first_step_near_the_bottle(monkeypatch: pytest.MonkeyPatch):
    """It is near from step 1 on, leaves, and is near again: decisions are at the steps 1, 3, 5, and not at 6."""
    monkeypatch.setattr(task, "distance", lambda states: states[:, 0])
    monkeypatch.setattr(openings, "_try", lambda engine, begin, episode, starts: np.full(len(episode), FAILS))
    near, far = openings.NEAR / 2, openings.NEAR * 2
    walk: Any = Walks([far, near, near, far, near, near, near])
    [(_, outcomes)] = openings._play_together(walk, [SOURCE.path(SETTINGS[0])], [])
    assert np.flatnonzero(outcomes != NO_DECISION).tolist() == [1, 3, 5]


def test_decisions_between_a_success_and_a_failure_are_tried_and_others_taken_to_be_equal(
    monkeypatch: pytest.MonkeyPatch,
):
    """Two episodes of 8 and 5 decisions; those with the marks + succeed. Every third one is tried first."""
    truth = np.array([char == "+" for char in "--++++-+++-++"])
    tried: list[int] = []

    def close(engine: Engine, begin: openings.Begin, episode: np.ndarray, starts: dict[str, np.ndarray]) -> np.ndarray:
        tried.extend(starts["row"].tolist())
        return np.where(truth[starts["row"]], 20.0, 3.0)

    monkeypatch.setattr(openings, "_close", close)
    episode = np.repeat([0, 1], [8, 5])
    outcomes = openings._try(None, None, episode, {"row": np.arange(13)})  # type: ignore[arg-type]
    assert tried == [0, 3, 6, 8, 11, 1, 2, 4, 5, 12]
    # Row 7 follows the failure of row 6, and nothing is tried after it; rows 9 and 10 lie between two successes.
    assert "".join("-+"[outcome] for outcome in outcomes) == "--++++--+++++"
