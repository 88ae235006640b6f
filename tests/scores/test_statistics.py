"""Estimates with known answers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import expit

from dextron_bench.scores import paired, statistics

BOARDS = 300  # Simulated ones. 95 % of their intervals hold the truth, within 2.5 % (two standard errors).
BOTH = np.array([0, 0, 0, 0, 1, 1, 1, 1])


def board(rng: np.random.Generator, seeds: int, settings: np.ndarray, spread: float) -> np.ndarray:
    """Scores (seeds, settings) of 0 and 20; seeds differ by `spread` in the logit, and `settings` is added to it."""
    chances = expit(1.0 + spread * rng.normal(size=(seeds, 1)) + settings)
    return 20.0 * (rng.uniform(size=chances.shape) < chances)


def mean_of_all(spread: float) -> float:
    """The expected score over all seeds and settings, if settings differ by 1.5 in the logit."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)  # The sum of both normal terms is normal.
    return float(20.0 * weights @ expit(1.0 + np.hypot(spread, 1.5) * nodes) / weights.sum())


def coverage(is_covered: Callable[[np.random.Generator], bool]) -> float:
    """The share of simulated boards whose interval holds the truth."""
    rng = np.random.default_rng(1)
    return float(np.mean([is_covered(rng) for _ in range(BOARDS)]))


def test_equal_scores_have_no_uncertainty():
    result = statistics.estimate(np.full((3, 50), 20.0), np.random.default_rng(0))
    assert (result.mean, result.low, result.high) == (20.0, 20.0, 20.0)


def test_interval_of_many_settings_matches_the_normal_one():
    scores = np.random.default_rng(1).normal(10.0, 2.0, (1, 400))
    result = statistics.estimate(scores, np.random.default_rng(0))
    half = 1.96 * scores.std() / np.sqrt(400)
    np.testing.assert_allclose([result.low, result.high], [scores.mean() - half, scores.mean() + half], atol=0.03)


def test_seeds_that_differ_widen_the_interval():
    settings = np.zeros((1, 100))
    seeds = np.array([[0.0], [10.0], [20.0]]) + settings
    result = statistics.estimate(seeds, np.random.default_rng(0))
    # With three seeds, all three draws are the lowest one with chance 1 / 27 > 0.025.
    assert (result.mean, result.low, result.high) == (10.0, 0.0, 20.0)


def test_draw_counts_add_up_to_the_number_of_items():
    result = statistics.draw_counts(7, np.random.default_rng(0))
    assert result.shape == (statistics.RESAMPLES, 7)
    assert (result.sum(axis=1) == 7.0).all()
    assert result.mean(axis=0) == pytest.approx(np.ones(7), abs=0.1)


def test_a_resample_is_the_mean_of_the_drawn_settings():
    """Two equal seeds; the settings are drawn 2 and 0 times: (2 * 6 + 0 * 20) / 2."""
    scores = np.array([[6.0, 20.0], [6.0, 20.0]])
    settings = np.tile([2.0, 0.0], (statistics.RESAMPLES, 1))
    assert (statistics.resampled_means(scores, settings, np.random.default_rng(0)) == 6.0).all()


@pytest.mark.parametrize(("seeds", "spread"), [(1, 0.0), (3, 0.2), (5, 0.2)])
def test_the_interval_holds_the_true_mean_nineteen_times_in_twenty(seeds: int, spread: float):
    """The difficulty of settings has a standard deviation of 1.5 in the logit."""
    truth = mean_of_all(spread)

    def is_covered(rng: np.random.Generator) -> bool:
        result = statistics.estimate(board(rng, seeds, 1.5 * rng.normal(size=100), spread), rng)
        return result.low <= truth <= result.high

    assert 0.92 <= coverage(is_covered) <= 0.98


def test_three_seeds_that_differ_much_make_an_interval_that_is_too_narrow():
    """docs/statistics.md warns of this: three seeds say little about the spread of seeds."""
    truth = mean_of_all(1.0)

    def is_covered(rng: np.random.Generator) -> bool:
        result = statistics.estimate(board(rng, 3, 1.5 * rng.normal(size=100), 1.0), rng)
        return result.low <= truth <= result.high

    assert 0.65 <= coverage(is_covered) < 0.9


def test_the_interval_of_a_difference_between_equals_holds_0_nineteen_times_in_twenty():
    def is_covered(rng: np.random.Generator) -> bool:
        settings = 1.5 * rng.normal(size=100)
        result = paired.difference(board(rng, 1, settings, 0.0), board(rng, 1, settings, 0.0), rng)
        return result.low <= 0.0 <= result.high

    assert 0.92 <= coverage(is_covered) <= 0.98


def test_a_difference_of_the_detectable_size_is_detected_four_times_in_five():
    """The true difference is 2.8 of its standard errors, 20 * sqrt(2 * 0.25 / 100), so the power is 80 %."""
    size = 2.8 * 20.0 * np.sqrt(2 * 0.25 / 100)
    detected, sizes = [], []
    rng = np.random.default_rng(3)
    for _ in range(BOARDS):
        a, b = (rng.normal(mean, 10.0, (1, 100)) for mean in (0.0, size))
        result = paired.difference(a, b, rng)
        detected.append(result.low > 0.0)
        sizes.append(result.detectable)
    assert 0.72 <= np.mean(detected) <= 0.88
    assert np.mean(sizes) == pytest.approx(size, rel=0.03)


def test_the_interquartile_mean_drops_the_worst_and_the_best_quarter():
    """The cells are 0, 8, 12 and 20, although the third has five settings. The mean of all settings would be 11."""
    scores = np.array([[0.0, 8.0, 12.0, 12.0, 12.0, 12.0, 12.0, 20.0]])
    strata = np.array([0, 1, 2, 2, 2, 2, 2, 3])
    result = statistics.interquartile_mean(scores, strata, np.random.default_rng(0))
    assert (result.mean, result.low, result.high) == (10.0, 10.0, 10.0)


def test_cells_of_the_interquartile_mean_are_seeds_by_strata():
    """The seeds score 4 and 16 in the first stratum, 6 and 20 in the second: the middle two of 4, 6, 16 and 20."""
    scores = np.array([[4.0] * 4 + [6.0] * 4, [16.0] * 4 + [20.0] * 4])
    result = statistics.interquartile_mean(scores, BOTH, np.random.default_rng(0))
    assert result.mean == 11.0
    assert (result.low, result.high) == (5.0, 18.0)  # Both draws give the same seed with chance 1 / 4.


def test_the_interquartile_mean_has_the_uncertainty_of_settings_within_strata():
    scores = np.array([[0.0, 20.0] * 4])
    result = statistics.interquartile_mean(scores, BOTH, np.random.default_rng(0))
    assert result.mean == 10.0
    assert result.low < 5.0 < 15.0 < result.high
