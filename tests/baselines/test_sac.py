"""Soft actor-critic: targets and losses by hand, separate gradients, and a task with a known solution."""

import math

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from baselines import sac
from baselines.sac import Batch, Sac


def column(*numbers: float) -> torch.Tensor:
    return torch.tensor(numbers)[None, :, None]


def batch(rng: np.random.Generator, agents: int, size: int = 4) -> Batch:
    def normal(width: int) -> torch.Tensor:
        return torch.tensor(rng.normal(size=(agents, size, width)), dtype=torch.float32)

    return Batch(normal(48), normal(1).tanh(), normal(1), normal(48), torch.ones(agents, size, 1))


def agents(*seeds: int) -> Sac:
    return Sac([np.random.default_rng(seed) for seed in seeds])


def test_a_truncated_episode_bootstraps_but_a_fall_does_not():
    target = sac.action_value_target(column(1.0, 1.0), column(1.0, 0.0), column(4.0, 4.0), discount=0.5)
    assert_close(target, column(3.0, 1.0))


def test_the_value_target_subtracts_the_log_density():
    assert_close(sac.value_target(column(3.0, 3.0), column(-2.0, 0.5)), column(5.0, 2.5))


def test_losses_by_hand():
    assert_close(sac.squared_error(column(1.0, 5.0), column(2.0, 2.0)), torch.tensor([5.0]))
    actual = sac.policy_loss(column(2.0, 4.0), column(1.0, 1.0), column(1.0, 0.0), column(0.0, 2.0))
    assert_close(actual, torch.tensor([(1 - 2 + 0.001 + 1 - 4 + 0.004) / 2]))


def test_with_two_critics_the_smaller_value_is_the_one_that_counts():
    """Both Q output a constant: 3 and 1; V's target and the policy's loss follow from 1, Q's losses from each."""
    learner = Sac([np.random.default_rng(0)], critics=2)
    weight, bias = learner.action_value.parameters[-2:]
    with torch.no_grad():
        weight.zero_()
        bias.copy_(torch.tensor([3.0, 1.0])[:, None, None])
        for parameter in (*learner.target.parameters, *learner.value.parameters, *learner.policy.parameters):
            parameter.zero_()
    rows = batch(np.random.default_rng(1), 1)
    rewards = torch.full_like(rows.rewards, 2.0)
    losses = learner.losses(Batch(rows.states, rows.actions, rewards, rows.nexts, rows.alive), torch.zeros(1, 4, 1))
    density = -0.5 * math.log(2.0 * math.pi)  # Of the action 0 under a standard normal, squashed with slope 1.
    assert_close(losses[:, 0], torch.tensor([1.0 + 1.0, (1.0 - density) ** 2, density - 1.0]))


@pytest.mark.parametrize(("loss", "network"), [(0, "action_value"), (1, "value"), (2, "policy")])
def test_the_gradient_of_each_loss_reaches_only_its_network(loss, network):
    learner = agents(0)
    learner.losses(batch(np.random.default_rng(1), 1), torch.zeros(1, 4, 1))[loss, 0].backward()
    reached = {
        name: any(p.grad is not None and p.grad.any() for p in getattr(learner, name).parameters)
        for name in ("policy", "action_value", "value")
    }
    assert reached == {name: name == network for name in reached}


def test_the_policys_gradient_goes_through_the_action():
    """With Q(s, a) = -100 (a - 0.5)^2 and constant entropy, the policy's action converges to 0.5."""
    mean = torch.zeros(1, 1, 1, requires_grad=True)
    for _ in range(400):
        action = mean.tanh()
        loss = sac.policy_loss(-100 * (action - 0.5).square(), torch.zeros(1, 1, 1), mean, torch.zeros(1, 1, 1))
        (slope,) = torch.autograd.grad(loss.sum(), mean)
        mean = (mean - 0.01 * slope).detach().requires_grad_()
    assert_close(mean.tanh(), column(0.5), atol=1e-3, rtol=0.0)


def test_seeds_trained_together_equal_seeds_trained_alone():
    """Sums have another order, so the last bits may differ: by 1e-4 after ten updates."""
    together, alone = agents(3, 4), agents(4)
    rng = np.random.default_rng(0)
    for _ in range(10):
        both, noise = batch(rng, 2), torch.tensor(rng.normal(size=(2, 4, 1)), dtype=torch.float32)
        together.update(both, noise)
        alone.update(Batch(*(getattr(both, name)[1:] for name in Batch.__slots__)), noise[1:])
    for actual, expected in zip(together.trained_parameters, alone.trained_parameters, strict=True):
        assert_close(actual[1:], expected, atol=1e-4, rtol=1e-3)


def test_the_target_follows_the_value_by_the_polyak_coefficient():
    learner = agents(0)
    before = learner.target.parameters[0].clone()
    learner.update(batch(np.random.default_rng(1), 1), torch.zeros(1, 4, 1))
    expected = before + 0.01 * (learner.value.parameters[0].detach() - before)
    assert_close(learner.target.parameters[0], expected)


def test_a_restored_learner_continues_bit_for_bit():
    first, second = agents(0, 1), agents(7, 8)
    rng = np.random.default_rng(2)
    for _ in range(3):
        first.update(batch(rng, 2), torch.zeros(2, 4, 1))
    second.load(first.save())
    more = batch(rng, 2)
    assert torch.equal(first.update(more, torch.ones(2, 4, 1)), second.update(more, torch.ones(2, 4, 1)))
    saved = second.save()
    assert all((array == saved[name]).all() for name, array in first.save().items())


@pytest.mark.slow
def test_sac_solves_a_bandit_with_a_known_solution():
    """Episodes of one step with reward 20 a s for action a in state s = -1 or 1.

    Then Q = 20 a s, and the optimal policy's density is proportional to exp(20 a s): its mean is
    s (coth 20 - 1/20) = 0.95 s.
    """
    learner, rng = agents(0, 1), np.random.default_rng(0)
    for _ in range(3000):
        signs = rng.choice([-1.0, 1.0], size=(2, 32, 1))
        states = np.zeros((2, 32, 48))
        states[..., :1] = signs
        actions = rng.uniform(-1.0, 1.0, (2, 32, 1))
        arrays = (states, actions, 20.0 * actions * signs, states, np.zeros((2, 32, 1)))
        noise = torch.tensor(rng.normal(size=(2, 32, 1)), dtype=torch.float32)
        learner.update(Batch(*(torch.tensor(array, dtype=torch.float32) for array in arrays)), noise)
    states = torch.zeros(2, 1000, 48)
    states[:, 500:, 0], states[:, :500, 0] = 1.0, -1.0
    played = learner.act(states, torch.tensor(rng.normal(size=(2, 1000, 1)), dtype=torch.float32))
    expected = 1 / math.tanh(20) - 1 / 20
    for agent in range(2):
        assert abs(played[agent, 500:].mean() - expected) < 0.05
        assert abs(played[agent, :500].mean() + expected) < 0.05
