"""Estimates with known answers."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
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
    result = statistics.estimate(np.full((3, 50), 20.0))
    assert (result.mean, result.low, result.high) == (20.0, 20.0, 20.0)


def test_interval_of_many_settings_matches_the_normal_one():
    scores = np.random.default_rng(1).normal(10.0, 2.0, (1, 400))
    result = statistics.estimate(scores)
    half = 1.966 * scores.std(ddof=1) / np.sqrt(400)  # Student's t of 399 degrees of freedom.
    np.testing.assert_allclose([result.low, result.high], [scores.mean() - half, scores.mean() + half], atol=1e-4)


def test_the_interval_of_one_seed_is_over_settings_alone():
    """Scores 9.6, 10 and 10.4: the standard error is 0.4 / sqrt(3), and t of two degrees of freedom is 4.3027."""
    half = 4.3027 * 4.0 / np.sqrt(300.0)
    result = statistics.estimate(np.array([[9.6, 10.0, 10.4]]))
    assert (result.low, result.high) == pytest.approx((10.0 - half, 10.0 + half), rel=1e-4)


def test_seeds_that_differ_widen_the_interval():
    """Seeds score 9, 10 and 11 on all settings: a standard error of 1 / sqrt(3), and t of two degrees of freedom."""
    seeds = np.array([[9.0], [10.0], [11.0]]) + np.zeros((1, 100))
    result = statistics.estimate(seeds)
    half = 4.3027 / np.sqrt(3.0)
    assert (result.mean, result.low, result.high) == pytest.approx((10.0, 10.0 - half, 10.0 + half), abs=1e-3)


def test_an_interval_ends_where_scores_end():
    result = statistics.estimate(np.array([[0.0], [10.0], [20.0]]) + np.zeros((1, 100)))
    assert (result.low, result.high) == (0.0, 20.0)
    assert statistics.estimate(np.array([[1.0, 1.0, 1.0, 0.0]]), statistics.SHARES).high == 1.0


def test_one_setting_says_nothing_of_others():
    result = statistics.estimate(np.array([[20.0]]))
    assert (result.low, result.high) == (0.0, 20.0)


@settings(max_examples=50, deadline=None)
@given(arrays(float, (3, 8), elements=st.integers(0, 20).map(float)), st.permutations(range(8)))
def test_the_order_of_settings_and_seeds_changes_no_bit(scores: np.ndarray, order: list[int]):
    assert statistics.estimate(scores) == statistics.estimate(scores[::-1, order])


@settings(max_examples=50, deadline=None)
@given(st.floats(0.01, 20.0), st.floats(0.01, 4.0), st.integers(1, 30), st.integers(1, 500))
def test_the_p_value_is_the_level_at_which_the_interval_ends_at_0(mean: float, ratio: float, few: int, many: int):
    parts = [statistics.Part(mean**2 * ratio, many), statistics.Part(mean**2 * ratio / 3.0, few)]
    p_value = statistics.p_value(mean, parts)
    assert statistics.half_width(parts, p_value) == pytest.approx(mean, rel=1e-6)
    assert (p_value < 0.05) == (statistics.half_width(parts) < mean)


def test_the_p_value_of_one_part_is_the_one_of_students_test():
    """t = 2.5 with 10 degrees of freedom."""
    assert statistics.p_value(2.5, [statistics.Part(1.0, 10.0)]) == pytest.approx(0.03145, rel=1e-3)
    assert statistics.p_value(0.0, [statistics.Part(1.0, 10.0)]) == 1.0
    assert statistics.p_value(1.0, [statistics.Part(0.0, 10.0)]) == 0.0


def test_draw_counts_add_up_to_the_number_of_items():
    result = statistics.draw_counts(7, np.random.default_rng(0))
    assert result.shape == (statistics.RESAMPLES, 7)
    assert (result.sum(axis=1) == 7.0).all()
    assert result.mean(axis=0) == pytest.approx(np.ones(7), abs=0.1)


@pytest.mark.parametrize(("seeds", "spread"), [(1, 0.0), (3, 0.0), (3, 0.2), (3, 0.5), (3, 1.0), (5, 0.5), (10, 0.2)])
def test_the_interval_holds_the_true_mean_nineteen_times_in_twenty(seeds: int, spread: float):
    """The difficulty of settings has a standard deviation of 1.5 in the logit; few seeds may differ much."""
    truth = mean_of_all(spread)

    def is_covered(rng: np.random.Generator) -> bool:
        result = statistics.estimate(board(rng, seeds, 1.5 * rng.normal(size=100), spread))
        return result.low <= truth <= result.high

    assert coverage(is_covered) >= 0.925


@pytest.mark.parametrize(("seeds", "spread"), [(1, 0.0), (3, 0.5), (5, 0.2)])
def test_the_interval_of_a_difference_between_equals_holds_0_nineteen_times_in_twenty(seeds: int, spread: float):
    def is_covered(rng: np.random.Generator) -> bool:
        hardness = 1.5 * rng.normal(size=100)
        result = paired.difference(board(rng, seeds, hardness, spread), board(rng, seeds, hardness, spread))
        return result.low <= 0.0 <= result.high

    assert coverage(is_covered) >= 0.925


def test_a_difference_of_the_detectable_size_is_detected_four_times_in_five():
    """The true difference is 2.8 of its standard errors, 20 * sqrt(2 * 0.25 / 100), so the power is 80 %."""
    size = 2.8 * 20.0 * np.sqrt(2 * 0.25 / 100)
    detected, sizes = [], []
    rng = np.random.default_rng(3)
    for _ in range(BOARDS):
        a, b = (rng.normal(mean, 10.0, (1, 100)) for mean in (0.0, size))
        result = paired.difference(a, b)
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
    """The seeds score 4 and 16 in the first stratum, 6 and 20 in the second: the middle two of 4, 6, 16 and 20.

    Two draws of two seeds give 5, 11, 11 or 18: a variance of 21.2, twice that for two seeds, t = 12.7: beyond 0 to 20.
    """
    scores = np.array([[4.0] * 4 + [6.0] * 4, [16.0] * 4 + [20.0] * 4])
    result = statistics.interquartile_mean(scores, BOTH, np.random.default_rng(0))
    assert result.mean == 11.0
    assert (result.low, result.high) == (0.0, 20.0)


def test_the_interquartile_mean_has_the_uncertainty_of_settings_within_strata():
    """The mean of a stratum has a variance of 25, of two 12.5; t of 7 degrees of freedom is 2.365."""
    scores = np.array([[0.0, 20.0] * 4])
    result = statistics.interquartile_mean(scores, BOTH, np.random.default_rng(0))
    assert result.mean == 10.0
    assert result.high - result.mean == pytest.approx(2.365 * 12.5**0.5, rel=0.05)


def test_the_interquartile_mean_has_the_uncertainty_of_few_seeds():
    """Three seeds score 9, 10 and 11 everywhere, so three drawn ones a <= b <= c have the mean (a + 2 b + c) / 4.

    The variance over all 27 draws belongs to seeds drawn from these three: 2/3 of the variance for seeds of a method.
    Student's t of two degrees of freedom is 4.3027.
    """
    seeds = np.array([9.0, 10.0, 11.0])
    draws = np.sort(np.array(list(itertools.product(seeds, repeat=3))), axis=1)
    variance = (draws @ [0.25, 0.5, 0.25]).var() * 3.0 / 2.0
    result = statistics.interquartile_mean(np.tile(seeds[:, None], 8), BOTH, np.random.default_rng(0))
    assert result.mean == 10.0
    assert result.high - result.mean == pytest.approx(4.3027 * variance**0.5, rel=0.05)
