"""Estimates whose answers are known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import expit

from dextron_bench.scores import paired, statistics

BOARDS = 300  # Simulated ones. 95 % of them are held give or take 2.5 %, by two standard errors.
BOTH = np.array([0, 0, 0, 0, 1, 1, 1, 1])


def board(rng: np.random.Generator, seeds: int, settings: np.ndarray, spread: float) -> np.ndarray:
    """Scores (seeds, settings) of 0 and 20; seeds differ by `spread` in the logit, settings by what they add to it."""
    chances = expit(1.0 + spread * rng.normal(size=(seeds, 1)) + settings)
    return 20.0 * (rng.uniform(size=chances.shape) < chances)


def mean_of_all(spread: float) -> float:
    """The mean score over all seeds and settings there could be, where settings differ by 1.5."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)  # Seeds' and settings' normal shares add up to one.
    return float(20.0 * weights @ expit(1.0 + np.hypot(spread, 1.5) * nodes) / weights.sum())


def held(one: Callable[[np.random.Generator], bool]) -> float:
    """The share of simulated boards whose interval holds the truth."""
    rng = np.random.default_rng(1)
    return float(np.mean([one(rng) for _ in range(BOARDS)]))


def test_equal_scores_have_no_uncertainty():
    found = statistics.estimate(np.full((3, 50), 20.0), np.random.default_rng(0))
    assert (found.mean, found.low, found.high) == (20.0, 20.0, 20.0)


def test_interval_of_many_settings_matches_the_normal_one():
    scores = np.random.default_rng(1).normal(10.0, 2.0, (1, 400))
    found = statistics.estimate(scores, np.random.default_rng(0))
    half = 1.96 * scores.std() / np.sqrt(400)
    np.testing.assert_allclose([found.low, found.high], [scores.mean() - half, scores.mean() + half], atol=0.03)


def test_seeds_that_differ_widen_the_interval():
    settings = np.zeros((1, 100))
    seeds = np.array([[0.0], [10.0], [20.0]]) + settings
    found = statistics.estimate(seeds, np.random.default_rng(0))
    # With three seeds, all three draws are the lowest one with chance 1 / 27 > 0.025.
    assert (found.mean, found.low, found.high) == (10.0, 0.0, 20.0)


def test_a_draw_counts_as_many_things_as_there_are():
    found = statistics.drawn(7, np.random.default_rng(0))
    assert found.shape == (statistics.RESAMPLES, 7)
    assert (found.sum(axis=1) == 7.0).all()
    assert found.mean(axis=0) == pytest.approx(np.ones(7), abs=0.1)


def test_a_resample_is_the_mean_of_what_was_drawn():
    """Settings drawn 2 and 0 times of seeds that are alike: (2 * 6 + 0 * 20) / 2."""
    scores = np.array([[6.0, 20.0], [6.0, 20.0]])
    settings = np.tile([2.0, 0.0], (statistics.RESAMPLES, 1))
    assert (statistics.resampled(scores, settings, np.random.default_rng(0)) == 6.0).all()


@pytest.mark.parametrize(("seeds", "spread"), [(1, 0.0), (3, 0.2), (5, 0.2)])
def test_the_interval_holds_the_true_mean_nineteen_times_in_twenty(seeds: int, spread: float):
    """Settings are harder or easier by 1.5 in the logit."""
    truth = mean_of_all(spread)

    def one(rng: np.random.Generator) -> bool:
        found = statistics.estimate(board(rng, seeds, 1.5 * rng.normal(size=100), spread), rng)
        return found.low <= truth <= found.high

    assert 0.92 <= held(one) <= 0.98


def test_three_seeds_that_differ_much_make_an_interval_that_is_too_narrow():
    """What docs/statistics.md warns of: three seeds say little about seeds."""
    truth = mean_of_all(1.0)

    def one(rng: np.random.Generator) -> bool:
        found = statistics.estimate(board(rng, 3, 1.5 * rng.normal(size=100), 1.0), rng)
        return found.low <= truth <= found.high

    assert 0.65 <= held(one) < 0.9


def test_the_interval_of_a_difference_between_equals_holds_none_nineteen_times_in_twenty():
    def one(rng: np.random.Generator) -> bool:
        settings = 1.5 * rng.normal(size=100)
        found = paired.difference(board(rng, 1, settings, 0.0), board(rng, 1, settings, 0.0), rng)
        return found.low <= 0.0 <= found.high

    assert 0.92 <= held(one) <= 0.98


def test_a_difference_that_shows_by_its_size_does_so_four_times_in_five():
    """The true difference is set to 2.8 standard errors of it, 20 * sqrt(2 * 0.25 / 100): power is 80 %."""
    size = 2.8 * 20.0 * np.sqrt(2 * 0.25 / 100)
    shown, told = [], []
    rng = np.random.default_rng(3)
    for _ in range(BOARDS):
        a, b = (rng.normal(mean, 10.0, (1, 100)) for mean in (0.0, size))
        found = paired.difference(a, b, rng)
        shown.append(found.low > 0.0)
        told.append(found.detectable)
    assert 0.72 <= np.mean(shown) <= 0.88
    assert np.mean(told) == pytest.approx(size, rel=0.03)


def test_the_interquartile_mean_leaves_out_the_worst_and_the_best_quarter():
    """Cells are 0, 8, 12, 20 whatever they hold; a plain mean of all settings were 11, the median of cells 10."""
    scores = np.array([[0.0, 8.0, 12.0, 12.0, 12.0, 12.0, 12.0, 20.0]])
    strata = np.array([0, 1, 2, 2, 2, 2, 2, 3])
    found = statistics.interquartile_mean(scores, strata, np.random.default_rng(0))
    assert (found.mean, found.low, found.high) == (10.0, 10.0, 10.0)


def test_cells_of_the_interquartile_mean_are_seeds_by_strata():
    """Seeds are worth 4 and 16 in the first stratum, 6 and 20 in the second: of 4, 6, 16, 20 the middle two."""
    scores = np.array([[4.0] * 4 + [6.0] * 4, [16.0] * 4 + [20.0] * 4])
    found = statistics.interquartile_mean(scores, BOTH, np.random.default_rng(0))
    assert found.mean == 11.0
    assert (found.low, found.high) == (5.0, 18.0)  # Both draws are the same seed with chance 1 / 4.


def test_the_interquartile_mean_is_as_unsure_as_settings_within_strata():
    scores = np.array([[0.0, 20.0] * 4])
    found = statistics.interquartile_mean(scores, BOTH, np.random.default_rng(0))
    assert found.mean == 10.0
    assert found.low < 5.0 < 15.0 < found.high
