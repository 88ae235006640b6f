"""Estimates whose answers are known."""

import numpy as np

from dextron_bench import stats


def test_equal_scores_have_no_uncertainty():
    found = stats.estimate(np.full((3, 50), 20.0), np.random.default_rng(0))
    assert (found.mean, found.low, found.high) == (20.0, 20.0, 20.0)


def test_interval_of_many_settings_matches_the_normal_one():
    scores = np.random.default_rng(1).normal(10.0, 2.0, (1, 400))
    found = stats.estimate(scores, np.random.default_rng(0))
    half = 1.96 * scores.std() / np.sqrt(400)
    np.testing.assert_allclose([found.low, found.high], [scores.mean() - half, scores.mean() + half], atol=0.03)


def test_seeds_that_differ_widen_the_interval():
    settings = np.zeros((1, 100))
    seeds = np.array([[0.0], [10.0], [20.0]]) + settings
    found = stats.estimate(seeds, np.random.default_rng(0))
    # With three seeds, all three draws are the lowest one with chance 1 / 27 > 0.025.
    assert (found.mean, found.low, found.high) == (10.0, 0.0, 20.0)


def test_the_interval_holds_the_true_mean_nineteen_times_in_twenty():
    rng = np.random.default_rng(2)
    held = 0
    for _ in range(100):
        found = stats.estimate(20.0 * (rng.uniform(size=(1, 80)) < 0.6), rng)
        held += found.low <= 12.0 <= found.high
    assert 88 <= held <= 100
