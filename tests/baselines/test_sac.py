"""Soft actor-critic: targets and losses by hand, gradients, and a task with a known solution."""

import math

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from baselines import policy, sac
from baselines.networks import Stack
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


def test_the_policys_loss_by_hand():
    actual = sac.policy_loss(column(2.0, 4.0), column(1.0, 1.0), column(1.0, 0.0), column(0.0, 2.0))
    assert_close(actual, torch.tensor([(1 - 2 + 0.001 + 1 - 4 + 0.004) / 2]))


def test_with_two_critics_the_smaller_value_is_the_one_that_counts():
    """Both Q output a constant: 3 and 1; V's target and the policy's loss follow from 1, Q's losses from each."""
    learner = Sac([np.random.default_rng(0)], critics=2)
    weight, bias = learner.action_value[-2:]
    weight.zero_()
    bias.copy_(torch.tensor([3.0, 1.0])[:, None, None])
    for parameter in (*learner.target, *learner.value, *learner.policy):
        parameter.zero_()
    rows = batch(np.random.default_rng(1), 1)
    rewards = torch.full_like(rows.rewards, 2.0)
    losses = learner.update(Batch(rows.states, rows.actions, rewards, rows.nexts, rows.alive), torch.zeros(1, 4, 1))
    density = -0.5 * math.log(2.0 * math.pi)  # Of the action 0 under a standard normal, squashed with slope 1.
    assert_close(losses[:, 0], torch.tensor([1.0 + 1.0, (1.0 - density) ** 2, density - 1.0]))


@pytest.mark.parametrize("critics", [1, 2])
def test_the_gradients_by_hand_equal_automatic_ones(critics: int):
    """Each loss is differentiated in the parameters of its own network alone."""
    learner = Sac([np.random.default_rng(seed) for seed in (0, 1)], critics=critics)
    rows, noise = batch(np.random.default_rng(2), 2), torch.randn(2, 4, 1, generator=torch.Generator().manual_seed(0))
    learner.policy[-1][..., 1] = torch.tensor([-0.4, 2.5])[:, None]  # The second agent's deviation is clamped.
    leaves = {
        name: [parameter.clone().requires_grad_() for parameter in getattr(learner, name)]
        for name in ("policy", "value", "action_value")
    }
    networks = {name: Stack(parameters) for name, parameters in leaves.items()}

    def q(stack: Stack, actions: torch.Tensor) -> torch.Tensor:
        return stack(torch.cat([rows.states, actions], dim=-1).repeat(critics, 1, 1)).unflatten(0, (critics, 2))

    mean, log_std = policy.head(networks["policy"](rows.states))
    actions, log_probability = policy.sample(mean, log_std, noise)
    smallest = q(Stack([parameter.detach() for parameter in leaves["action_value"]]), actions).amin(dim=0)
    target = sac.action_value_target(rows.rewards, rows.alive, Stack(learner.target)(rows.nexts), sac.DISCOUNT)
    q_loss = (q(networks["action_value"], rows.actions) - target).square().mean(dim=(-2, -1)).sum(dim=0)
    wanted = sac.value_target(smallest, log_probability).detach()
    v_loss = (networks["value"](rows.states) - wanted).square().mean(dim=(-2, -1))
    losses = torch.stack([q_loss, v_loss, sac.policy_loss(smallest, log_probability, mean, log_std)])
    losses.sum().backward()
    assert_close(learner.differentiate(rows, noise), losses.detach())
    layers = learner.networks.layers_of(learner.networks.gradients)
    for part, expected in zip((slice(0, 2), slice(2, 4), slice(4, None)), leaves.values(), strict=True):
        for layer, leaf in zip(layers, expected, strict=True):
            assert leaf.grad is not None
            unpadded = layer[part, : leaf.shape[1], : leaf.shape[2]]
            assert_close(unpadded, leaf.grad)
            assert unpadded.count_nonzero() == layer[part].count_nonzero()  # The padding has no gradient.


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
    for name in ("policy", "action_value", "value"):
        for actual, expected in zip(getattr(together, name), getattr(alone, name), strict=True):
            assert_close(actual[1:], expected, atol=1e-4, rtol=1e-3)


def test_the_target_follows_the_value_by_the_polyak_coefficient():
    learner = agents(0)
    before = learner.target[0].clone()
    learner.update(batch(np.random.default_rng(1), 1), torch.zeros(1, 4, 1))
    expected = before + 0.01 * (learner.value[0] - before)
    assert_close(learner.target[0], expected)


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
