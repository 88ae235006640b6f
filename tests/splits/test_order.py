"""The random order of rows is a permutation, and stays the same."""

from __future__ import annotations

from dextron_bench.experts.policies import Case, Expert
from dextron_bench.reaches.setting import Setting
from dextron_bench.splits.loading import Split
from dextron_bench.splits.order import random_order

CASE = Case(Setting("a", 0.0, 0.0, 0.0), Expert(1.0, 0.1), 0.1)


def split(digest: str) -> Split:
    return Split(name="test", reaches="synthetic", digest=digest, cases=(CASE,) * 10)


def test_the_order_has_every_row_once_and_is_frozen():
    """Rows sorted by the hashes of "a 0" to "a 9"; other versions of a split have other orders."""
    assert random_order(split("a")) == [9, 3, 8, 7, 2, 4, 5, 6, 1, 0]
    assert sorted(random_order(split("b"))) == list(range(10))
    assert random_order(split("b")) != random_order(split("a"))
