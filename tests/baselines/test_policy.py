"""The policy's densities, compared with SciPy and by hand, and the agent that plays the mean."""

import math

import numpy as np
import torch
from scipy.integrate import quad
from scipy.stats import norm
from torch.testing import assert_close

from baselines import policy


def one(number: float) -> torch.Tensor:
    return torch.tensor([[[number]]], dtype=torch.float64)


def test_the_density_is_the_gaussian_density_divided_by_the_slope_of_tanh():
    mean, deviation, noise = 0.3, 0.5, 1.2
    raw = mean + deviation * noise  # 0.9
    expected = float(norm.logpdf(raw, mean, deviation)) - math.log(1.0 - math.tanh(raw) ** 2)
    action, actual = policy.sample(one(mean), one(math.log(deviation)), one(noise))
    assert_close(actual, one(expected))
    assert_close(action, one(math.tanh(0.9)))


def test_the_density_integrates_to_one_over_the_actions():
    def density(action: float) -> float:
        raw = math.atanh(action)
        return float(policy.log_probability(one(raw), one(math.log(0.8)), one((raw + 0.4) / 0.8)).exp())

    assert abs(quad(density, -1.0, 1.0)[0] - 1.0) < 1e-6


def test_the_density_stays_finite_if_tanh_rounds_to_one():
    actual = policy.log_probability(one(50.0), one(0.0), one(0.0))
    assert_close(
        actual, one(-0.5 * math.log(2 * math.pi) + 2.0 * (50.0 - math.log(2.0)))
    )  # log(1 - tanh^2) ~ 2(log 2 - u)


def test_the_deviation_is_kept_within_bounds():
    mean, log_std = policy.head(torch.tensor([[[1.0, -50.0], [2.0, 9.0]]]))
    assert_close(mean, torch.tensor([[[1.0], [2.0]]]))
    assert_close(log_std, torch.tensor([[[-20.0], [2.0]]]))


def test_the_agent_scales_and_clips_states_and_plays_the_mean():
    first = np.zeros((48, 1))
    first[0] = 1.0
    ones, zero = np.ones((1, 1)), np.zeros((1, 1))
    layers = [first, zero, ones, zero, np.array([[0.5, 9.0]]), np.zeros((1, 2))]
    weights = {f"policy.{i}": layer for i, layer in enumerate(layers)}
    agent = policy.MeanAgent(weights | {"mean": np.full(48, 2.0), "deviation": np.full(48, 4.0)})
    states = np.zeros((3, 48))
    states[:, 0] = [6.0, 1e6, 2.0]  # scaled: 1, 10 (clipped), 0
    np.testing.assert_allclose(agent.act(states)[:, 0], np.tanh([0.5, 5.0, 0.0]), atol=1e-6)
    assert agent.act(states).dtype == np.float64


def test_a_likelihood_ratio_has_the_same_expected_gradient_as_the_gradient_through_the_action():
    """Of E[log density - Q] in mean and log deviation, for Q = -3 (a - 0.5)^2. Four standard errors are 0.03."""
    parameters = torch.tensor([0.3, -0.5], dtype=torch.float64, requires_grad=True)
    noise = torch.tensor(np.random.default_rng(0).normal(size=400_000))
    mean, log_std = parameters
    actions, density = policy.sample(mean, log_std, noise)
    (through,) = torch.autograd.grad((density + 3.0 * (actions - 0.5).square()).mean(), parameters, retain_graph=True)
    raw = (mean + log_std.exp() * noise).detach()
    of_fixed_action = policy.log_probability(raw, log_std, (raw - mean) / log_std.exp())
    advantage = (density + 3.0 * (actions - 0.5).square()).detach()
    (ratio,) = torch.autograd.grad((of_fixed_action * advantage).mean(), parameters)
    assert_close(ratio, through, atol=0.03, rtol=0.0)
