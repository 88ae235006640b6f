"""Tracks in a rollout: actions arrive late, readings have errors, and a replay of the actions is still exact."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.perturbation import FINGERS, Perturbation, with_errors
from dextron_bench.evaluation.replay import replay
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.splits.rows import Rows
from dextron_bench.splits.tracks import PLAIN, TRACKS, Noise, Track
from dextron_bench.world import model
from dextron_bench.world.bottle import Bottle
from tests.helpers.short_reaches import SETTINGS, SOURCE

CASES = [Case(setting, Expert(1.2, 0.3), 0.1) for setting in SETTINGS[:3]]
HEAVY = [Bottle(2.0 + k, 1.0, 0.03) for k in range(3)]  # One for each case of a track of the bottle.
STRONG = Noise(0.01, 0.1, 0.2, 0.3, 0.4, 0.25)


class Watcher:
    """Acts by the height of the palm that it sees, and keeps all that it saw."""

    def __init__(self) -> None:
        self.seen: list[np.ndarray] = []
        self.sent: list[np.ndarray] = []

    def reset(self, episodes: np.ndarray) -> None:
        """Does nothing."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Actions (N, 1) in [-1, 1]."""
        self.seen.append(states)
        self.sent.append(np.sin(100.0 * states[:, 9:10]))
        return self.sent[-1]


def played(track: Track, slots: int = 8, cases: list[Case] = CASES) -> dict[int, Episode]:
    bottles = tuple(HEAVY[CASES.index(case)] for case in cases) if track.bottle else ()
    return dict(rollout(Watcher(), SOURCE, Rows(cases=tuple(cases), track=track, bottles=bottles), slots, 1))


def test_actions_arrive_after_the_delay():
    perturbation, slots = Perturbation(Track("t", delay=2), 2), np.arange(2)
    perturbation.begin(slots, SETTINGS[:2])
    sent = [np.array([[0.1 * t], [-0.1 * t]]) for t in range(1, 5)]
    arrived = [perturbation.delay(actions)[0, 0] for actions in sent]
    assert arrived == [0.0, 0.0, 0.1, 0.2]
    perturbation.begin(slots[:1], SETTINGS[:1])  # Only this slot begins again.
    np.testing.assert_allclose(perturbation.delay(sent[0])[:, 0], [0.0, -0.3])


def test_episodes_under_a_delay_have_the_actions_that_arrived_and_are_replayed_exactly():
    agent = Watcher()
    row = Rows(cases=(CASES[0],), track=TRACKS["delay-100"])
    [(_, episode)] = rollout(agent, SOURCE, row, 1, 1)
    assert (episode.actions[:5] == 0.0).all()
    np.testing.assert_array_equal(episode.actions[5:, 0], np.concatenate(agent.sent)[: len(episode.actions) - 5, 0])
    for played in (row, [episode.setting]):  # Stored actions are those that arrived: the delay does not count twice.
        [(_, again)] = replay(SOURCE, played, [episode.actions[:, 0]])
        np.testing.assert_array_equal(again.states, episode.states)
    assert again.score == episode.score


@pytest.mark.parametrize("name", TRACKS)
def test_episodes_do_not_depend_on_slots_or_order(name: str):
    together, alone = played(TRACKS[name]), played(TRACKS[name], slots=1)
    backwards = played(TRACKS[name], slots=2, cases=CASES[::-1])
    for k in range(len(CASES)):
        for other in (alone[k], backwards[len(CASES) - 1 - k]):
            np.testing.assert_array_equal(together[k].states, other.states)
            np.testing.assert_array_equal(together[k].actions, other.actions)


@pytest.mark.slow
def test_tracks_differ_from_plain_episodes_and_a_track_without_conditions_does_not():
    plain, unconditional = played(PLAIN), played(Track("nothing"))
    for k in range(len(CASES)):
        np.testing.assert_array_equal(plain[k].states, unconditional[k].states)
    for track in TRACKS.values():
        assert any(
            len(one.actions) != len(other.actions) or (one.states != other.states).any()
            for one, other in zip(plain.values(), played(track).values(), strict=True)
        )


def test_errors_have_their_sizes_and_orientations_stay_of_unit_length():
    states = np.zeros((4000, model.STATE))
    states[:, 3] = states[:, 10] = 1.0
    rng = np.random.default_rng(0)
    sensed = with_errors(states, rng.standard_normal(states.shape), STRONG)
    errors = sensed - states
    for columns, size in (
        ([0, 1, 2, 7, 8, 9], 0.01),
        (FINGERS, 0.2),
        ([25, 26, 27, 31, 32, 33], 0.3),
        ([28, 34, 47], 0.4),
    ):
        np.testing.assert_allclose(errors[:, columns].std(axis=0), size, rtol=0.06)
    for quaternion in (sensed[:, 3:7], sensed[:, 10:14]):
        np.testing.assert_allclose((quaternion**2).sum(axis=1), 1.0)
        np.testing.assert_allclose(2.0 * quaternion[:, 1:].std(axis=0), 0.1, rtol=0.06)


def test_a_lost_reading_repeats_the_last_one():
    perturbation = Perturbation(Track("t", noise=STRONG), 1)
    perturbation.begin(np.array([0]), SETTINGS[:1])
    seen, states = [], np.zeros((1, model.STATE))
    states[:, 3] = states[:, 10] = 1.0
    for _ in range(400):
        seen.append(perturbation.sense(states)[0])
        perturbation.delay(np.zeros((1, 1)))
    repeated = np.mean([(one == other).all() for one, other in pairwise(seen)])
    assert 0.18 < repeated < 0.32
    assert (seen[0] != 0.0).any()


def test_the_agent_sees_the_errors_but_the_episode_has_none():
    agent = Watcher()
    noisy = Rows(cases=(CASES[0],), track=Track("t", noise=replace(STRONG, lost=0.0)))
    [(_, episode)] = rollout(agent, SOURCE, noisy, 1, 1)
    seen = np.concatenate(agent.seen)
    assert (seen[:, 7:10] != episode.states[: len(seen), 7:10]).all()
    np.testing.assert_allclose((seen[:, 7:10] - episode.states[: len(seen), 7:10]).std(), 0.01, rtol=0.2)
