"""STOPPING: its features, the labels of its training, its loss by hand, and when its agent closes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from baselines import generated_reaches, openings, pose_features, stopping_trainer
from baselines.stopping import BadNumber, Stopping, StoppingAgent
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.openings import FAILS, NO_DECISION, SUCCEEDS, Episode, Openings
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.methods.learners import Arrays, TrainingSetup
from dextron_bench.reaches.setting import OFFSET, Setting
from dextron_bench.splits.near_equal import NEAR_NOISE
from dextron_bench.world import model, task
from tests.helpers.short_reaches import SETTINGS, SOURCE

CASES = [Case(setting, Expert(1.2, 0.3), 0.1) for setting in SETTINGS]


@pytest.fixture(scope="module")
def played() -> Openings:
    """The openings of the five short settings."""
    return openings.joined(openings.play(SOURCE, SETTINGS, threads=1))


@pytest.mark.slow
def test_openings_are_kept_by_reach_and_a_damaged_file_is_named(
    played: Openings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    reported: list[tuple[int, int]] = []
    everything = TrainingSetup(
        SOURCE, CASES * 2, tmp_path, 1, report=lambda done, total, note: reported.append((done, total))
    )
    first_reach = SETTINGS[0].reach
    first = openings.load(everything, openings.settings_of(everything))
    assert len(first) == len(CASES)  # Each setting counts once.
    assert reported == [(0, 5), (0, 5)]  # Both reaches are played together.
    for loaded, expected in zip(first, played.episodes(), strict=True):
        np.testing.assert_array_equal(loaded[0], expected[0])
        np.testing.assert_array_equal(loaded[1], expected[1])
    monkeypatch.setattr(openings, "play", None)
    others = [case for case in CASES if case.setting.reach != first_reach]
    part = openings.load(TrainingSetup(SOURCE, others, tmp_path, threads=1), [case.setting for case in others])
    expected = [outcomes for case, (_, outcomes) in zip(CASES, first, strict=True) if case in others]
    np.testing.assert_array_equal(np.concatenate([outcomes for _, outcomes in part]), np.concatenate(expected))
    file = min(tmp_path.iterdir())
    file.write_bytes(file.read_bytes()[:-10])
    with pytest.raises(Exception, match=file.name):
        openings.load(everything, openings.settings_of(everything))


def test_nearby_settings_are_near_equal_to_no_row_that_is_drawn_with_an_equal_duration():
    setting = Setting("a", OFFSET, -0.01, 0.3)
    near = [one for batch in range(10) for one in openings.nearby(setting, batch)]
    assert near[:10] == openings.nearby(setting, 0) + openings.nearby(setting, 1)
    assert len(set(near)) == 50
    assert openings.nearby(Setting("a", OFFSET, -0.01, 0.31), 0)[0] not in near
    moved = np.array([[one.offset_x, one.offset_y + 0.01, one.duration_noise - 0.3] for one in near])
    assert {one.reach for one in near} == {"a"}
    assert OFFSET - 0.01 <= moved[:, 0].min() < moved[:, 0].max() == OFFSET  # Clipped to the largest offset.
    assert -0.01 <= moved[:, 1].min() < -0.005 < 0.005 < moved[:, 1].max() <= 0.01
    assert NEAR_NOISE < moved[:, 2].min() < moved[:, 2].max() <= 0.25


def test_more_nearby_settings_begin_with_the_fewer_ones_and_share_their_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Each setting's own three and six copies, distinguished by what a fake play returns."""
    played: list[Setting] = []

    def play(source: object, settings: Sequence[Setting], threads: int) -> list[Episode]:
        played.extend(settings)
        return [(np.full((1, model.STATE), setting.offset_x), np.zeros(1, np.int8)) for setting in settings]

    monkeypatch.setattr(openings, "play", play)
    setup = TrainingSetup(SOURCE, CASES, tmp_path, threads=1)
    three, six = (openings.load_nearby(setup, SETTINGS, copies) for copies in (3, 6))
    assert len(played) == 2 * 5 * len(SETTINGS)  # Two batches of five, each played once.
    offsets = [[float(states[0, 0]) for states, _ in episodes] for episodes in six]
    near = [[*openings.nearby(one, 0), openings.nearby(one, 1)[0]] for one in SETTINGS]
    np.testing.assert_allclose(offsets, [[one.offset_x for one in group] for group in near], rtol=1e-6)
    assert [[float(states[0, 0]) for states, _ in episodes] for episodes in three] == [row[:3] for row in offsets]
    assert openings.load_nearby(setup, SETTINGS, 0) == [[] for _ in SETTINGS]


def test_the_rule_closes_at_the_first_decision_within_its_distance():
    """Decisions at 0.10, 0.06 and 0.04 m, and a state without one at 0.05 m."""
    states = np.zeros((4, model.STATE))
    states[:, :25] = model.initial_qpos()
    states[:, model.PALM_POSITION] = 0.0
    centre = task.palm_centre(states)[0]
    states[:, model.BOTTLE_POSITION] = np.add(centre, [[d, 0.0, 0.0] for d in (0.10, 0.06, 0.05, 0.04)])
    episode = states, np.array([FAILS, SUCCEEDS, NO_DECISION, FAILS], np.int8)
    assert [openings.rule_succeeds(episode, edge) for edge in (0.11, 0.07, 0.055, 0.01)] == [False, True, False, False]


def test_measurements_of_a_pose_by_hand():
    """The palm looks along the world's x; its centre lies 3 cm before the bottle's axis and 2 cm to the side."""
    states = np.zeros((1, model.STATE))
    states[:, :25] = model.initial_qpos()
    states[:, model.PALM_QUATERNION] = [1.0, 0.0, 0.0, 0.0]
    states[:, model.PALM_POSITION] = 0.0
    centre = task.palm_centre(states)[0]
    states[:, model.BOTTLE_POSITION] = np.add(centre, [0.03, 0.02, 0.05])
    half = np.sqrt(0.5)
    states[:, model.BOTTLE_QUATERNION] = [half, half, 0.0, 0.0]  # Lies on its side.
    (measured,) = pose_features.measure(states)
    np.testing.assert_allclose(measured[pose_features.BOTTLE], [0.03, 0.02, 0.05], atol=1e-12)
    np.testing.assert_allclose(measured[pose_features.WORLD_UP], [0.0, 0.0, 1.0])
    assert measured[pose_features.DISTANCE] == pytest.approx(np.hypot(0.03, 0.02))
    assert measured[pose_features.TILT] == pytest.approx(1.0)


def test_the_time_to_contact_by_hand():
    """0.10 m away, and 0.06 m more three steps ago: 1 m/s, so 0.1 s are left. A hand that goes away gets the limit."""
    now, past = np.full((2, pose_features.WIDTH), 0.1), np.full((2, pose_features.WIDTH), 0.1)
    past[:, pose_features.DISTANCE] = 0.16, 0.04
    np.testing.assert_allclose(pose_features._time_to_contact(now, past, 3)[:, 0], [0.1, pose_features.LONGEST])


def test_features_of_whole_episodes_equal_those_that_an_agent_sees(played: Openings):
    """Two episodes of different lengths in one history; the first row begins again after the shorter one."""
    first, second = (played.states[played.rows(number)].astype(float) for number in (0, 1))
    history, whole = pose_features.History(), [pose_features.of_episode(one) for one in (first, second)]
    history.reset(np.arange(2))
    for t in range(len(second)):
        if t == len(first):
            history.reset(np.array([0]))
        history.add(np.stack([first[t % len(first)], second[t]]))
        seen = history.features(np.arange(2))
        np.testing.assert_array_equal(seen, [whole[0][t % len(first)], whole[1][t]])
    assert whole[0].shape == (len(first), pose_features.COUNT)


def test_the_expected_success_by_hand():
    """Each decision closes with probability 1/2, so it is reached with probability 1, 1/2 and 1/4."""
    chance = stopping_trainer.expected_success(torch.zeros(3), torch.tensor([1.0, 0.0, 1.0]))
    assert_close(chance, torch.tensor(0.5 + 0.125))
    late = stopping_trainer.expected_success(torch.tensor([-50.0, -50.0, 50.0]), torch.tensor([0.0, 0.0, 1.0]))
    assert_close(late, torch.tensor(1.0))


def test_the_learning_rate_rises_from_a_25th_and_falls_to_nothing():
    rates = [stopping_trainer.learning_rate(progress) for progress in (0.0, 0.15, 0.3, 0.65, 1.0)]
    assert rates == pytest.approx([3e-3 / 25, 3e-3 * 0.52, 3e-3, 1.5e-3, 0.0])


def zero_weights(edge: float) -> Arrays:
    """Weights of two networks that output 0, with a ramp that is positive within `edge` [m]."""
    sizes = (pose_features.COUNT, 4, 4, 2)
    layers: Arrays = {}
    for i in range(3):
        layers |= {
            f"network.{2 * i}": np.zeros((2, *sizes[i : i + 2])),
            f"network.{2 * i + 1}": np.zeros((2, 1, sizes[i + 1])),
        }
    ones = np.ones(pose_features.COUNT)
    return {**layers, "ramp": np.array([[edge, 100.0]] * 2), "mean": 0.0 * ones, "deviation": ones}


def test_without_a_network_the_agent_closes_for_good_at_the_edge_of_the_ramp():
    """The distances are 0.2, 0.15 (a decision), 0.05 (none), 0.05, and 0.3: it closes at the fourth state."""
    states = np.zeros((5, 1, model.STATE))
    states[..., :25] = model.initial_qpos()
    states[..., model.PALM_POSITION] = 0.0
    centre = task.palm_centre(states[0])[0]
    for state, distance in zip(states, (0.2, 0.15, 0.05, 0.05, 0.3), strict=True):
        state[..., model.BOTTLE_POSITION] = np.add(centre, [distance, 0.0, 0.0])
    agent = StoppingAgent(zero_weights(edge=0.06))
    agent.reset(np.array([0]))
    assert [float(agent.act(state)[0, 0]) for state in states] == [-1.0, -1.0, -1.0, 1.0, 1.0]


@pytest.fixture
def trainer(tmp_path: Path, played: Openings) -> Callable[..., stopping_trainer.StoppingTrainer]:
    """Makes trainers on the short settings."""

    def make(*seeds: int) -> stopping_trainer.StoppingTrainer:
        return stopping_trainer.StoppingTrainer(stopping_trainer.Decisions(played.episodes(), "cpu"), seeds)

    return make


@pytest.mark.slow
def test_training_learns_to_close_where_closing_succeeds(
    trainer: Callable[..., stopping_trainer.StoppingTrainer], played: Openings
):
    learner = trainer(0)
    losses = [learner.advance()[0]["stopping_loss"] for _ in range(3)]
    assert losses[-1] < losses[0] - 0.1
    solvable = [number for number in range(len(played)) if (played.outcomes[played.rows(number)] == SUCCEEDS).any()]
    agent = StoppingAgent(learner.weights()[0])
    scores = [episode.score for _, episode in rollout(agent, SOURCE, [CASES[number] for number in solvable], 2, 1)]
    assert scores == [task.SUCCESS] * len(solvable)


@pytest.mark.slow
def test_it_learns_from_what_closing_can_solve_on_generated_reaches_too(
    played: Openings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The generated reaches are the short ones again, so each setting that can be solved counts twice."""
    asked: list[tuple[Sequence[Setting], int]] = []

    def generate(source: object, known: Sequence[Setting], count: int) -> object:
        asked.append((known, count))
        return SOURCE, SETTINGS

    monkeypatch.setattr(generated_reaches, "generate", generate)
    given: list[int] = []
    monkeypatch.setattr(stopping_trainer, "Decisions", lambda episodes, device: given.append(len(episodes)))
    monkeypatch.setattr(stopping_trainer, "StoppingTrainer", lambda *_: None)
    Stopping(nearby=0, generated=7).trainer(TrainingSetup(SOURCE, CASES, tmp_path, threads=1), [0])
    assert asked == [(list(SETTINGS), 7)]
    solvable = sum((outcomes == SUCCEEDS).any() for _, outcomes in played.episodes())
    assert given == [len(SETTINGS) + solvable]


def test_impossible_numbers_are_refused():
    with pytest.raises(BadNumber, match="--settings is -1"):
        Stopping(settings=-1)
    with pytest.raises(BadNumber, match="--nearby is -2"):
        Stopping(nearby=-2)
    with pytest.raises(BadNumber, match="--generated is -1"):
        Stopping(generated=-1)


def test_labels_name_the_numbers_that_are_not_the_defaults():
    assert [Stopping().label, Stopping(settings=400, nearby=0).label] == ["stopping", "stopping-400-nearby0"]
    assert Stopping(generated=100).label == "stopping-generated100"
