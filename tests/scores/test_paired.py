"""Paired comparisons: answers computed by hand, and properties that hold for all scores."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dextron_bench.scores import paired
from dextron_bench.scores.statistics import Part

RETURNS = st.integers(0, 20).map(float)
ROWS = 6


def scores(seeds: int) -> st.SearchStrategy[np.ndarray]:
    return arrays(float, (seeds, ROWS), elements=RETURNS)


def solved(*rows: str) -> np.ndarray:
    """Successes (seeds, settings) written as ones and zeros."""
    return np.array([[letter == "1" for letter in row] for row in rows])


def test_a_constant_lead_is_certain_even_if_settings_differ_much():
    a = np.array([[0.0, 5.0, 19.0, 3.0, 7.0, 7.0]])
    result = paired.difference(a, a + 1.0)
    assert (result.mean, result.low, result.high, result.detectable) == pytest.approx((1.0, 1.0, 1.0, 0.0), abs=1e-12)


def test_the_seeds_of_two_methods_have_welchs_degrees_of_freedom():
    """Variances 4 and 1 with 2 and 9 degrees of freedom: 5^2 / (4^2 / 2 + 1^2 / 9), between 2 and 11."""
    (seeds,) = paired.pooled([Part(4.0, 2.0), Part(1.0, 9.0)])
    assert (seeds.variance, seeds.freedom) == pytest.approx((5.0, 225.0 / 73.0))


@pytest.mark.parametrize("settings", [1, 2, 5])
def test_a_constant_lead_on_few_settings_says_nothing(settings: int):
    """Two settings that A fails and B solves would otherwise have a p value of 0."""
    result = paired.difference(np.zeros((1, settings)), np.full((1, settings), 20.0))
    assert (result.mean, result.low, result.high, result.p_value) == (20.0, -20.0, 20.0, 1.0)


def test_equal_scores_on_few_settings_are_equal():
    result = paired.difference(np.ones((1, 2)), np.ones((1, 2)))
    assert (result.mean, result.low, result.high, result.p_value) == (0.0, 0.0, 0.0, 1.0)


def test_the_difference_is_between_means_over_seeds_and_settings():
    a, b = np.array([[0.0, 10.0], [20.0, 10.0]]), np.array([[10.0, 20.0]])
    assert paired.difference(a, b).mean == 5.0


def test_the_interval_is_the_normal_one_of_differences_over_many_settings():
    noise = np.random.default_rng(1)
    a = noise.normal(10.0, 6.0, (1, 400))
    b = a + noise.normal(0.5, 2.0, (1, 400))
    result, error = paired.difference(a, b), (b - a).std() / 20.0
    assert result.high - result.low == pytest.approx(2 * 1.96 * error, rel=0.05)
    assert result.detectable == pytest.approx((1.96 + 0.84) * error, rel=0.05)


def test_seeds_of_two_methods_are_drawn_independently():
    """A and B have the same three seeds. If they were drawn together, the difference would always be 0."""
    a = np.array([[9.0], [10.0], [11.0]]) + np.zeros((1, 20))
    result = paired.difference(a, a)
    half = 2.7764 * np.sqrt(2.0 / 3.0)  # Student's t of 2 + 2 degrees of freedom.
    assert (result.low, result.high) == pytest.approx((-half, half), rel=1e-4)


@pytest.mark.parametrize(("lead", "worse"), [(-2.0, True), (0.0, False), (2.0, False)])
def test_worse_means_that_the_whole_interval_is_below_0(lead: float, worse: bool):
    a = np.random.default_rng(2).normal(10.0, 1.0, (1, 100))
    b = a + lead + np.random.default_rng(3).normal(0.0, 1.0, (1, 100))
    assert paired.difference(a, b).is_worse == worse


@settings(max_examples=25)
@given(scores(2), scores(3))
def test_swapping_the_methods_changes_the_sign(a: np.ndarray, b: np.ndarray):
    forward, backward = paired.difference(a, b), paired.difference(b, a)
    assert (forward.mean, forward.low, forward.high) == (-backward.mean, -backward.high, -backward.low)
    assert (forward.detectable, forward.p_value) == (backward.detectable, backward.p_value)
    assert forward.low - 1e-9 <= forward.high


@settings(max_examples=25)
@given(scores(2), scores(3))
def test_the_p_value_is_below_5_percent_if_the_interval_excludes_0(a: np.ndarray, b: np.ndarray):
    result = paired.difference(a, b)
    assert (result.p_value < 0.05) == (result.low > 0.0 or result.high < 0.0)


def test_holms_correction_multiplies_the_smallest_p_value_by_their_number():
    """0.01 * 4, 0.02 * 3, 0.03 * 2, and 0.04 * 1, which is raised to the one before."""
    assert paired.holm([0.04, 0.01, 0.03, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert paired.holm([0.9, 0.8]) == [1.0, 1.0]
    assert paired.holm([]) == []


@settings(max_examples=50)
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8))
def test_holms_correction_keeps_the_order_and_lowers_no_p_value(p_values: list[float]):
    corrected = np.array(paired.holm(p_values))
    assert (corrected >= p_values).all()
    assert corrected.min() == min(1.0, len(p_values) * min(p_values))
    assert (np.diff(corrected[np.argsort(p_values)]) >= 0.0).all()


def test_flips_are_counted_and_tested_as_in_mcnemars_test():
    """Three gained, one lost: at most 1 of 4 flips goes to one side with chance (1 + 4) / 16, to either with twice."""
    result = paired.flips(solved("0001110"), solved("1110110"))
    assert (result.gained.tolist(), result.lost.tolist()) == ([0, 1, 2], [3])
    assert result.p_value == pytest.approx(0.625)


def test_six_flips_to_one_side_are_beyond_chance():
    assert paired.flips(solved("000000"), solved("111111")).p_value == pytest.approx(2 / 2**6)


def test_nothing_flips_between_equals():
    result = paired.flips(solved("0101"), solved("0101"))
    assert (len(result.gained), len(result.lost), result.p_value) == (0, 0, 1.0)


def test_a_setting_flips_once_by_the_number_of_seeds_that_solve_it():
    result = paired.flips(solved("110", "010", "010"), solved("010", "110", "000"))
    assert (result.gained.tolist(), result.lost.tolist()) == (
        [],
        [1],
    )  # Row 0: one seed each; row 1: three against two.


def test_both_methods_count_with_the_same_number_of_seeds():
    """The second seed of B has no counterpart in A. If it counted, all rows would be gained."""
    result = paired.flips(solved("1111"), solved("1111", "1111"))
    assert (result.gained.tolist(), result.lost.tolist()) == ([], [])


@settings(max_examples=50)
@given(arrays(bool, (2, ROWS)), arrays(bool, (3, ROWS)))
def test_swapping_the_methods_swaps_gained_and_lost(a: np.ndarray, b: np.ndarray):
    forward, backward = paired.flips(a, b), paired.flips(b, a)
    assert forward.gained.tolist() == backward.lost.tolist()
    assert forward.p_value == backward.p_value
    assert 0.0 < forward.p_value <= 1.0


def test_pairs_are_tested_by_the_noise_of_their_difference():
    """Each mean has a standard error of 1, but a draw of settings that helps one method helps the other too."""
    common = np.random.default_rng(4).permutation(np.repeat([-20.0, 20.0], 200))[None]
    assert paired.difference(10.0 + common, 9.9 + common).is_worse
