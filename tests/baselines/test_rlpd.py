"""RLPD: targets by hand, what each step changes, the two halves of a batch, and a task with a known solution."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from baselines import cycle, demonstrations, rlpd
from baselines.rlpd import Ensemble, Rlpd
from baselines.sac import Batch
from dextron_bench.errors import BadInput
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.methods.learners import TrainingSetup
from dextron_bench.reaches.setting import Setting
from tests.helpers.short_reaches import SOURCE
from tests.helpers.tiny_benchmark import SOLVED


def batch(rng: np.random.Generator, agents: int, size: int = 4) -> Batch:
    def normal(width: int) -> torch.Tensor:
        return torch.tensor(rng.normal(size=(agents, size, width)), dtype=torch.float32)

    return Batch(normal(48), normal(1).tanh(), normal(1), normal(48), torch.ones(agents, size, 1))


def learner(*seeds: int, critics: int = 3) -> Ensemble:
    return Ensemble([np.random.default_rng(seed) for seed in seeds], "cpu", critics)


@torch.no_grad()
def with_constant_values(ensemble: Ensemble, *values: float) -> None:
    """Makes the target Q output constants, by number in the stack, and the policy a standard normal before its tanh."""
    ensemble.targets[-2].zero_()
    ensemble.targets[-1].copy_(torch.tensor(values)[:, None, None])
    for parameter in ensemble.policy:
        parameter.zero_()


def test_the_target_is_the_smaller_value_of_each_agents_pair_less_the_price_of_entropy():
    """Agent 0 has Q of 1, 2, 3, and agent 1 of 10, 20, 30; the temperature is 0.5, and the second bottle falls."""
    ensemble = learner(0, 1)
    with_constant_values(ensemble, 1.0, 10.0, 2.0, 20.0, 3.0, 30.0)
    with torch.no_grad():
        ensemble.log_temperature.fill_(math.log(0.5))
    rows = batch(np.random.default_rng(0), 2, size=2)
    rewards, alive = torch.full((2, 2, 1), 4.0), torch.tensor([1.0, 0.0])[None, :, None].expand(2, 2, 1)
    rows = Batch(rows.states, rows.actions, rewards, rows.nexts, alive)
    target = ensemble.value_target(rows, torch.zeros(2, 2, 1), np.array([[2, 1], [0, 2]]))
    density = -0.5 * math.log(2.0 * math.pi)  # Of the action 0 under a standard normal, squashed with slope 1.
    alive_targets = [4.0 + 0.99 * (smaller - 0.5 * density) for smaller in (2.0, 10.0)]
    assert_close(target[..., 0], torch.tensor([[alive_targets[0], 4.0], [alive_targets[1], 4.0]]))


def test_a_normalised_critic_does_not_grow_with_its_inputs():
    """Its hidden units have a norm of at most sqrt(256), so actions far outside the data keep Q within a bound."""
    ensemble = learner(0)
    near, far = (
        rlpd.action_values(ensemble.values, torch.zeros(3, 1, 48), torch.full((3, 1, 1), action))
        for action in (1e3, 1e6)
    )
    assert_close(near, far, rtol=1e-2, atol=1e-4)


def test_each_step_changes_its_own_networks_alone():
    ensemble, rows = learner(0, 1), batch(np.random.default_rng(1), 2)
    policies, values, targets = (
        [parameter.detach().clone() for parameter in part]
        for part in (ensemble.policy, ensemble.values, ensemble.targets)
    )
    ensemble.update_values(rows, torch.zeros(2, 4, 1), np.array([[0, 1], [1, 2]]))
    assert all(map(torch.equal, ensemble.policy, policies))
    for target, before, after in zip(ensemble.targets, targets, ensemble.values, strict=True):
        assert not torch.equal(target, before)
        assert_close(target, before + 0.005 * (after.detach() - before))
    values = [parameter.detach().clone() for parameter in ensemble.values]
    ensemble.update_policy(rows.states, torch.zeros(2, 4, 1))
    assert all(map(torch.equal, ensemble.values, values))
    assert not any(map(torch.equal, ensemble.policy, policies))


@pytest.mark.parametrize(("deviation", "sign"), [(math.log(0.01), 1.0), (0.0, -1.0)])
def test_the_temperature_rises_if_the_policys_entropy_is_too_low(deviation: float, sign: float):
    """A deviation of 0.01 has an entropy of -3.2, a deviation of 1 one of about 0.6; -0.5 is wanted."""
    ensemble = learner(0)
    with torch.no_grad():
        for parameter in ensemble.policy:
            parameter.zero_()
        ensemble.policy[-1][..., 1] = deviation
    noise = torch.tensor(np.random.default_rng(0).normal(size=(1, 1000, 1)), dtype=torch.float32)
    ensemble.update_policy(torch.zeros(1, 1000, 48), noise)
    assert float(ensemble.log_temperature.detach()) * sign > 0.0


def test_seeds_trained_together_equal_seeds_trained_alone():
    together, alone, rng = learner(3, 4), learner(4), np.random.default_rng(0)
    for _ in range(5):
        both, noise = batch(rng, 2), torch.tensor(rng.normal(size=(2, 4, 1)), dtype=torch.float32)
        second = Batch(*(getattr(both, name)[1:] for name in Batch.__slots__))
        together.update_values(both, noise, np.array([[0, 1], [2, 0]]))
        alone.update_values(second, noise[1:], np.array([[2, 0]]))
        together.update_policy(both.states, noise)
        alone.update_policy(second.states, noise[1:])
    for actual, expected in zip(together.policy, alone.policy, strict=True):
        assert_close(actual[1:], expected, atol=1e-4, rtol=1e-3)
    for actual, expected in zip(together.values, alone.values, strict=True):
        assert_close(actual[1::2], expected, atol=1e-4, rtol=1e-3)


def test_half_of_a_batch_comes_from_all_demonstrations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """From the first update on; the paper's RLIL has only the demonstrations that were streamed so far."""
    cases = [Case(Setting(*row[:4]), Expert(*row[4:6]), row[6]) for row in SOLVED]
    setup = TrainingSetup(SOURCE, cases, tmp_path, threads=1)
    demos, trainer = demonstrations.load(setup), Rlpd(batch=8).trainer(setup, [0])
    assert isinstance(trainer, cycle.Cycle)
    rows = demos.transitions()
    first = demonstrations.Everything.of(demos).select(np.array([[0.0, 0.5, 1.0 - 1e-9]]), frames=0)
    expected = rows[[0, len(rows) // 2, len(rows) - 1]]
    np.testing.assert_array_equal(first.states[0], demos.states[expected])
    np.testing.assert_array_equal(first.nexts[0], demos.states[expected + 1])
    monkeypatch.setattr(cycle, "FRAMES", 3)
    trainer.advance()
    rewarded = np.flatnonzero(demos.rewards[rows] > 0.0)[0]
    made = trainer._batch(np.full((1, 8), (rewarded + 0.5) / len(rows)))
    assert made.rewards[0, :, 0].tolist() == [1.0] * 4 + [0.0] * 4  # They are not scaled.
    action = float(demos.actions[rows[rewarded]])
    assert made.actions[0, :4, 0].tolist() == [action] * 4
    assert (made.actions[0, 4:, 0] != action).all()


def test_labels_name_the_settings_that_differ_and_impossible_ones_are_refused():
    assert Rlpd().label == "rlpd"
    assert Rlpd(critics=10, updates=20, batch=256, preset="quick").label == "rlpd-10c-20u-256b-quick"
    for settings in ({"critics": 1}, {"updates": 0}, {"batch": 7}, {"batch": 0}):
        with pytest.raises(BadInput, match="give 2 critics or more"):
            Rlpd(**settings)  # type: ignore[arg-type]


@pytest.mark.thorough
def test_it_solves_a_bandit_with_a_known_best_action():
    """Episodes of one step with reward 5 a s for action a in state s = -1 or 1: the best action is s."""
    ensemble, rng = learner(0, 1), np.random.default_rng(0)
    for _ in range(1500):
        signs = rng.choice([-1.0, 1.0], size=(2, 32, 1))
        states = np.zeros((2, 32, 48))
        states[..., :1] = signs
        actions = rng.uniform(-1.0, 1.0, (2, 32, 1))
        arrays = (states, actions, 5.0 * actions * signs, states, np.zeros((2, 32, 1)))
        rows = Batch(*(torch.tensor(array, dtype=torch.float32) for array in arrays))
        noise = torch.tensor(rng.normal(size=(2, 32, 1)), dtype=torch.float32)
        ensemble.update_values(rows, noise, np.array([[0, 1], [1, 2]]))
        ensemble.update_policy(rows.states, noise)
    states = torch.zeros(2, 2, 48)
    states[:, 0, 0], states[:, 1, 0] = 1.0, -1.0
    played = ensemble.act(states, torch.zeros(2, 2, 1))
    assert (played[:, 0] > 0.8).all()
    assert (played[:, 1] < -0.8).all()
