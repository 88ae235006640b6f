"""Ranks of a round by hand, and what nobody can do to them: property tests."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dextron_bench.scores import ranks
from dextron_bench.scores.ranks import QUANTILE


def solved(**splits: list[list[int]]) -> dict[str, np.ndarray]:
    """What a method solves, by split: a list for each seed."""
    return {name: np.array(seeds, float) for name, seeds in splits.items()}


def test_a_score_is_the_mean_of_the_splits_whatever_their_number_of_settings():
    """Of two seeds, 3 of 4 episodes of one split are solved, and 2 of 8 of the other: (0.75 + 0.25) / 2."""
    method = solved(people=[[1, 1], [1, 0]], hard=[[1, 0, 0, 0], [0, 0, 0, 1]])
    assert ranks.score(method) == 0.5
    assert ranks.seed_scores(method) == [(1.0 + 0.25) / 2, (0.5 + 0.25) / 2]


def test_the_margin_by_hand():
    """Differences on the one split: 1, 0, 0, 0 between the first two, whose squared standard error is 0.25 / 4.

    The third has two seeds, one solves all four settings and one none: a variance between seeds of 1 / 2. Its
    differences from the others are 0.5, -0.5, -0.5, -0.5 and -0.5 four times: squared standard errors 0.25 / 4 and 0.
    """
    first, second = solved(hard=[[1, 0, 0, 0]]), solved(hard=[[0, 0, 0, 0]])
    third = solved(hard=[[1, 1, 1, 1], [0, 0, 0, 0]])
    computed = ranks.margin([first, second, third])
    assert computed.settings == pytest.approx(0.25)
    assert computed.seeds == pytest.approx(math.sqrt(2 / 3 * 0.5))
    assert computed.size == pytest.approx(2.58 * math.sqrt(0.25 / 4 + 1 / 3))
    assert ranks.margin([first]) == (0.0, 0.0, 0.0)


def test_the_variance_of_two_splits_is_a_quarter_of_their_sum():
    first = solved(people=[[1, 0]], hard=[[1, 0, 0, 0]])
    second = solved(people=[[0, 0]], hard=[[0, 0, 0, 0]])
    assert ranks.margin([first, second]).settings == pytest.approx(math.sqrt((0.5 / 2 + 0.25 / 4) / 4))


def test_ranks_by_hand():
    """The leader is 0.05 ahead of the second, which is within the margin; the third is 0.07 behind it, and 0.02 behind
    the second: one method is ahead of it. A method of an author with two methods ahead has rank 2, not 3."""
    scores = {"a": 0.80, "b": 0.75, "c": 0.73, "d": 0.30, "e": 0.30}
    assert ranks.ranks(scores, 0.06, {}) == {"a": 1, "b": 1, "c": 2, "d": 4, "e": 4}
    assert ranks.ranks(scores, 0.06, {"a": "x", "b": "x"}) == {"a": 1, "b": 1, "c": 2, "d": 3, "e": 3}
    assert QUANTILE == 2.58


NAMES = st.sampled_from("abcdefgh")
SCORES = st.dictionaries(NAMES, st.integers(0, 100).map(lambda percent: percent / 100), min_size=2)
AUTHORS = st.dictionaries(NAMES, st.sampled_from(["x", "y"]))
MARGINS = st.integers(0, 30).map(lambda percent: percent / 100 + 0.001)


@given(SCORES, MARGINS, AUTHORS)
def test_a_lower_score_never_ranks_better(scores: dict[str, float], margin: float, authors: dict[str, str]):
    computed = ranks.ranks(scores, margin, authors)
    ordered = sorted(scores, key=lambda name: -scores[name])
    assert [computed[name] for name in ordered] == sorted(computed.values())
    assert computed[ordered[0]] == 1


@given(SCORES, MARGINS, AUTHORS, NAMES)
def test_no_row_changes_the_order_of_two_others(
    scores: dict[str, float], margin: float, authors: dict[str, str], removed: str
):
    """Without the row, a method that was behind another, or beside it, is not ahead of it."""
    assume(removed in scores)
    left = {name: score for name, score in scores.items() if name != removed}
    before, after = ranks.ranks(scores, margin, authors), ranks.ranks(left, margin, authors)
    for name in left:
        for other in left:
            if before[name] > before[other]:
                assert after[name] >= after[other]


@given(SCORES, MARGINS)
def test_who_is_beaten_by_more_than_the_margin_shares_no_rank_with_the_winner(scores: dict[str, float], margin: float):
    computed = ranks.ranks(scores, margin, {})
    for name, score in scores.items():
        for other, lower in scores.items():
            if score > lower + margin:
                assert computed[name] < computed[other]


@given(SCORES, MARGINS, st.integers(1, 20))
def test_clones_of_one_author_cost_others_one_rank(scores: dict[str, float], margin: float, count: int):
    """Twenty clones at the top count as one method."""
    clones = {f"clone{number}": 1.0 for number in range(count)}
    alone = ranks.ranks(scores, margin, {})
    beside = ranks.ranks(scores | clones, margin, dict.fromkeys(clones, "cloner"))
    assert all(beside[name] <= alone[name] + 1 for name in scores)


@given(st.lists(st.lists(st.integers(0, 1), min_size=6, max_size=6), min_size=3, max_size=3))
def test_an_entrants_own_spread_changes_no_margin(seeds: list[list[int]]):
    """The margin is a function of baselines alone; an entrant's seeds enter by their mean only."""
    entrant = solved(hard=seeds)
    flat = np.mean(seeds, axis=0)[None]
    assert ranks.score(entrant) == pytest.approx(ranks.score({"hard": flat}))
