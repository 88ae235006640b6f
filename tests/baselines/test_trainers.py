"""The contract of all trainers: exact resuming, independent seeds, and weights that act."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from baselines import cycle, rl, stopping_trainer
from baselines.bc import Cloning, imitation_loss
from baselines.dagger import Aggregation
from baselines.demonstrations import load
from baselines.policy import MeanAgent
from baselines.rlpd import Rlpd
from baselines.schedule import Exploration, Schedule
from baselines.stopping import Stopping, StoppingAgent
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.methods.learners import Trainer, TrainingSetup
from tests.helpers.short_reaches import SETTINGS, SOURCE

CASES = [Case(setting, Expert(1.2, 0.3), 0.1) for setting in SETTINGS]
FRAMES = 40  # Of an epoch.
SCHEDULE = Schedule(epochs=4, warm_start=30, period=1)
QUICK = ("rlil", "bc")
SLOW = ("rl", "held", "dagger", "rlpd", "stopping")
KINDS = (*QUICK, *(pytest.param(kind, marks=pytest.mark.slow) for kind in SLOW))


@pytest.fixture(autouse=True)
def short_epochs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shortens epochs to 40 frames, 2 episodes, or 5 updates of BC, DAGGER or STOPPING."""
    monkeypatch.setattr(cycle, "FRAMES", FRAMES)
    monkeypatch.setattr("baselines.bc.STEPS", 5)
    monkeypatch.setattr("baselines.rlpd.WARM_START", 30)
    monkeypatch.setattr("baselines.dagger.EPISODES", 2)
    monkeypatch.setattr(stopping_trainer, "UPDATES", 5)


def trainer(kind: str, folder: Path, seeds: tuple[int, ...] = (0, 1), schedule: Schedule = SCHEDULE) -> Trainer:
    setup = TrainingSetup(SOURCE, CASES, folder, threads=1)
    if kind == "bc":
        return Cloning(load(setup), seeds)
    if kind == "dagger":
        return Aggregation(setup, load(setup), seeds)
    if kind == "stopping":
        return Stopping().trainer(setup, seeds)
    if kind == "rlpd":
        return Rlpd(critics=3, updates=2, batch=16).trainer(setup, seeds)
    if kind == "held":
        return rl.trainer(setup, seeds, schedule, 9, Exploration(hold=7, share=0.5), critics=2)
    return rl.trainer(setup, seeds, schedule, demonstrated=0 if kind == "rl" else 9)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which demonstrations and openings are played once for all tests."""
    return tmp_path_factory.mktemp("cache")


@pytest.mark.parametrize("kind", KINDS)
def test_a_restored_trainer_continues_bit_for_bit(kind: str, cache: Path):
    first, journals = trainer(kind, cache), []
    for _ in range(2):
        first.advance()
        journals.append(first.journal())
    second = trainer(kind, cache)
    second.restore(first.state(), journals)
    assert second.epoch == 2
    for _ in range(2):
        assert first.advance() == second.advance()
    arrays, restored = ({**one.state(), **one.journal()} for one in (first, second))
    assert arrays.keys() == restored.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(array, restored[name], err_msg=name)


@pytest.mark.parametrize("kind", ["rlil", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("rl", "held"))])
def test_a_short_training_equals_the_first_epochs_of_a_long_one(kind: str, cache: Path):
    short, long = (trainer(kind, cache, schedule=Schedule(epochs, 30, 1)) for epochs in (2, 7))
    for _ in range(2):
        assert short.advance() == long.advance()


@pytest.mark.parametrize("kind", KINDS)
def test_training_does_not_depend_on_the_number_of_threads(kind: str, cache: Path):
    before, metrics = torch.get_num_threads(), []
    try:
        for threads in (1, 3):
            torch.set_num_threads(threads)
            learner = trainer(kind, cache)
            metrics.append([learner.advance() for _ in range(2)])
    finally:
        torch.set_num_threads(before)
    assert metrics[0] == metrics[1]


@pytest.mark.parametrize("kind", KINDS)
def test_equal_seeds_train_equally_and_other_seeds_do_not(kind: str, cache: Path):
    first, second = trainer(kind, cache), trainer(kind, cache)
    metrics = [first.advance() for _ in range(2)]
    assert metrics == [second.advance() for _ in range(2)]
    one, other = first.weights()
    assert any((one[name] != other[name]).any() for name in one)


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_trains_equally_alone_and_with_other_seeds(kind: str, cache: Path):
    """The order of sums differs, and physics and Adam amplify the difference, so only the losses are compared.

    `test_sac.py` compares the weights, without physics.
    """
    schedule = Schedule(epochs=4, warm_start=75, period=1)
    together, alone = trainer(kind, cache, (0, 1), schedule), trainer(kind, cache, (1,), schedule)
    _ = together.advance(), alone.advance()
    (other_seed, actual), (expected,) = together.advance(), alone.advance()
    tolerance = 1e-3 if kind in ("dagger", "stopping") else 1e-2
    assert actual == pytest.approx(expected, rel=tolerance)
    assert other_seed != pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize("kind", KINDS)
def test_the_weights_give_agents_that_act(kind: str, cache: Path):
    learner = trainer(kind, cache)
    learner.advance()
    for weights in learner.weights():
        agent = StoppingAgent(weights) if kind == "stopping" else MeanAgent(weights)
        agent.reset(np.arange(3))
        actions = agent.act(np.random.default_rng(0).normal(size=(3, 48)))
        assert actions.shape == (3, 1)
        assert (np.abs(actions) <= 1.0).all()


def test_updates_start_after_the_warm_start(tmp_path: Path):
    learner = trainer("rl", tmp_path)
    (first, _), (second, _) = learner.advance(), learner.advance()
    assert first["frames"] == FRAMES
    assert second["frames"] == 2 * FRAMES
    assert "value_loss" in first
    assert "value_loss" in second
    late = rl.trainer(TrainingSetup(SOURCE, CASES, tmp_path, threads=1), [0], Schedule(2, 100, 1), 0)
    before = late.weights()[0]["policy.4"]
    assert "value_loss" not in late.advance()[0]
    np.testing.assert_array_equal(late.weights()[0]["policy.4"], before)


def test_held_noise_is_renewed_every_hold_steps_and_updates_begin_after_a_batch(tmp_path: Path):
    """In the warm start the noise is the action, so the actions themselves are held, from the start of each episode."""
    setup = TrainingSetup(SOURCE, CASES, tmp_path, threads=1)
    learner = rl.trainer(setup, [0], Schedule(4, 400, 1), 0, Exploration(hold=7))
    (metrics,) = learner.advance()
    assert "value_loss" in metrics
    journal = learner.journal()
    actions, ended = journal["actions"][:, 0], journal["ended"][:, 0].astype(bool)
    blocks = actions[: (np.argmax(ended) or len(actions)) // 7 * 7].reshape(-1, 7)  # Of the first episode.
    assert len(blocks) >= 3
    assert (blocks == blocks[:, :1]).all()
    assert len(np.unique(blocks[:, 0])) == len(blocks)


def test_after_the_warm_start_a_share_of_the_episodes_holds_its_noise(tmp_path: Path):
    setup = TrainingSetup(SOURCE, CASES, tmp_path, threads=1)
    noises = []
    for share in (0.0, 1.0):
        learner = rl.trainer(setup, [0], Schedule(4, 0, 1), 0, Exploration(hold=40, share=share))
        fresh = np.random.default_rng(0).normal(size=(40, 1, 1))
        held = []
        for noise in fresh:
            held.append(float(learner._hold(noise, everywhere=False)[0, 0]))
            learner._length += 1
        noises.append(len(set(held)))
    assert noises == [40, 1]


def test_the_imitation_loss_by_hand():
    actual = imitation_loss(torch.tensor([[[0.0], [100.0]]]), torch.tensor([[[0.5], [-1.0]]]))
    torch.testing.assert_close(actual, torch.tensor([(0.25 + 4.0) / 2]))


@pytest.mark.slow
def test_behaviour_cloning_recovers_an_expert(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """After a thousand updates on one expert's demonstrations, the actions differ by less than 0.1 (RMS)."""
    monkeypatch.setattr("baselines.bc.STEPS", 250)
    demos = load(TrainingSetup(SOURCE, CASES, tmp_path, threads=1))
    cloning = Cloning(demos, [0])
    for _ in range(4):
        cloning.advance()
    rows = demos.transitions()
    actions = MeanAgent(cloning.weights()[0]).act(demos.states[rows].astype(np.float64))
    assert np.sqrt(np.mean((actions[:, 0] - demos.actions[rows]) ** 2)) < 0.1
