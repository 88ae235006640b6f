"""Paired comparisons with answers done by hand, and what holds for any scores."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dextron_bench.scores import paired

RETURNS = st.integers(0, 20).map(float)
ROWS = 6


def scores(seeds: int) -> st.SearchStrategy[np.ndarray]:
    return arrays(float, (seeds, ROWS), elements=RETURNS)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def solved(*rows: str) -> np.ndarray:
    """Successes (seeds, settings) written as ones and zeros."""
    return np.array([[letter == "1" for letter in row] for row in rows])


def test_a_constant_lead_is_certain_however_much_settings_differ():
    a = np.array([[0.0, 5.0, 19.0, 3.0]])
    found = paired.difference(a, a + 1.0, rng())
    assert (found.mean, found.low, found.high, found.detectable) == pytest.approx((1.0, 1.0, 1.0, 0.0), abs=1e-12)


def test_the_difference_is_that_of_means_over_seeds_and_settings():
    a, b = np.array([[0.0, 10.0], [20.0, 10.0]]), np.array([[10.0, 20.0]])
    assert paired.difference(a, b, rng()).mean == 5.0


def test_the_interval_is_the_normal_one_of_differences_over_many_settings():
    made = np.random.default_rng(1)
    a = made.normal(10.0, 6.0, (1, 400))
    b = a + made.normal(0.5, 2.0, (1, 400))
    found, error = paired.difference(a, b, rng()), (b - a).std() / 20.0
    assert found.high - found.low == pytest.approx(2 * 1.96 * error, rel=0.05)
    assert found.detectable == pytest.approx((1.96 + 0.84) * error, rel=0.05)


def test_seeds_of_two_methods_are_drawn_apart():
    """A and B have the same three seeds; were they drawn together, the difference would always be 0."""
    a = np.array([[0.0], [10.0], [20.0]]) + np.zeros((1, 20))
    found = paired.difference(a, a, rng())
    assert found.low < -8.0
    assert found.high > 8.0


@pytest.mark.parametrize(("lead", "worse"), [(-2.0, True), (0.0, False), (2.0, False)])
def test_only_a_whole_interval_below_none_is_worse(lead: float, worse: bool):
    a = np.random.default_rng(2).normal(10.0, 1.0, (1, 100))
    b = a + lead + np.random.default_rng(3).normal(0.0, 1.0, (1, 100))
    assert paired.difference(a, b, rng()).is_worse == worse


@settings(max_examples=25, deadline=None)
@given(scores(2), scores(3))
def test_what_b_scores_more_than_a_is_what_a_scores_less_than_b(a: np.ndarray, b: np.ndarray):
    there, back = paired.difference(a, b, rng()), paired.difference(b, a, rng())
    assert (there.mean, there.low, there.high) == pytest.approx((-back.mean, -back.high, -back.low), abs=1e-9)
    assert there.detectable == pytest.approx(back.detectable)
    assert there.low - 1e-9 <= there.high


def test_flips_are_counted_and_tested_as_mcnemar_does():
    """Three gained, one lost: of 4 flips 1 or fewer fall to a side with chance (1 + 4) / 16, either side twice that."""
    found = paired.flips(solved("0001110"), solved("1110110"))
    assert (found.gained.tolist(), found.lost.tolist()) == ([0, 1, 2], [3])
    assert found.p_value == pytest.approx(0.625)


def test_six_flips_to_one_side_are_beyond_chance():
    assert paired.flips(solved("000000"), solved("111111")).p_value == pytest.approx(2 / 2**6)


def test_nothing_flips_between_equals():
    found = paired.flips(solved("0101"), solved("0101"))
    assert (len(found.gained), len(found.lost), found.p_value) == (0, 0, 1.0)


def test_a_setting_flips_once_by_the_number_of_seeds_that_solve_it():
    found = paired.flips(solved("110", "010", "010"), solved("010", "110", "000"))
    assert (found.gained.tolist(), found.lost.tolist()) == ([], [1])  # Row 0: one seed each, row 1: three against two.


def test_as_many_seeds_of_either_method_are_tested():
    """The second seed of B has none to stand against; were it counted, all rows would be gained."""
    found = paired.flips(solved("1111"), solved("1111", "1111"))
    assert (found.gained.tolist(), found.lost.tolist()) == ([], [])


@settings(max_examples=50, deadline=None)
@given(arrays(bool, (2, ROWS)), arrays(bool, (3, ROWS)))
def test_flips_seen_from_the_other_side_are_the_same(a: np.ndarray, b: np.ndarray):
    there, back = paired.flips(a, b), paired.flips(b, a)
    assert there.gained.tolist() == back.lost.tolist()
    assert there.p_value == back.p_value
    assert 0.0 < there.p_value <= 1.0


def around(*means: float) -> list[np.ndarray]:
    """Scores of a seed of each of some independent methods on 400 settings; each mean has a standard error of 1."""
    made, noise = np.random.default_rng(4), np.repeat([-20.0, 20.0], 200)
    return [mean + made.permutation(noise)[None] for mean in means]


def test_ranks_are_shared_by_those_that_cannot_be_told_from_the_best_of_their_group():
    """Standard errors of differences are 1.4: 20 and 19 are not told apart, 20 and 14 are, 14 and 13 are not."""
    assert paired.ranks(around(13.0, 20.0, 5.0, 19.0, 14.0)) == [3, 1, 5, 1, 3]


def test_a_chain_of_neighbours_breaks_where_its_best_is_left_behind():
    """Neighbours are 2 apart, which does not show; 20 and 16 are 4 apart, which does, and 16 opens a group."""
    assert paired.ranks(around(20.0, 18.0, 16.0, 14.0)) == [1, 1, 3, 3]


def test_pairs_are_told_apart_by_the_noise_of_their_difference():
    """Alone, each is unsure by 1; a draw of settings that helps one helps the other."""
    (common,) = around(0.0)
    assert paired.ranks([10.0 + common, 9.9 + common]) == [1, 2]


def test_of_equal_means_the_same_one_opens_the_group_in_any_order():
    """The third is told apart from the one that is sure, not from the one that is unsure."""
    (unsure,) = around(10.0)
    sure, third = np.full((1, 400), 10.0), np.full((1, 400), 9.5)
    one, other, last = paired.ranks([sure, unsure, third])
    assert paired.ranks([unsure, sure, third]) == [other, one, last]


def test_nobody_has_no_rank():
    assert paired.ranks([]) == []


@settings(max_examples=25, deadline=None)
@given(scores(2), scores(3))
def test_two_share_a_rank_where_the_published_interval_holds_0(a: np.ndarray, b: np.ndarray):
    found = paired.published(a, b)
    assert (paired.ranks([a, b]) == [1, 1]) == (found.low <= 0.0 <= found.high)


@settings(max_examples=25, deadline=None)
@given(st.lists(scores(2), min_size=2, max_size=5), st.randoms(use_true_random=False))
def test_ranks_do_not_hang_on_the_order_of_methods(boards: list[np.ndarray], random):
    order = random.sample(range(len(boards)), len(boards))
    assume(order != sorted(order))
    found = paired.ranks(boards)
    assert paired.ranks([boards[k] for k in order]) == [found[k] for k in order]
    assert min(found) == 1
    assert found[int(np.argmax([each.mean() for each in boards]))] == 1
