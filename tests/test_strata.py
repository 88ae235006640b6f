"""Strata are those of the reaches themselves."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dextron_bench import splits
from dextron_bench.strata import strata
from dextron_bench.world.setting import Source


@pytest.mark.parametrize(("reaches", "split"), [(r, s) for r, s in splits.everything() if s == "test"])
def test_strata_are_those_that_the_source_tells(reaches: str, split: str, opened: Callable[[str], Source]):
    loaded, source = splits.load(reaches, split), opened(reaches)
    told = [source.stratum(case.setting.reach) for case in loaded.cases]
    expected = [(each.subject, each.ring, each.angle) for each in told]
    assert list(strata(loaded).itertuples(index=False, name=None)) == expected


def test_a_recorded_reach_says_by_its_name_whose_it_is():
    """Marker 11 is the third on the third ring of four."""
    split = splits.load("real", "test")
    row = next(i for i, case in enumerate(split.cases) if case.setting.reach.endswith("_11"))
    found = strata(split).iloc[row]
    assert (found["subject"], found["ring"], found["angle"]) == (split.cases[row].setting.reach[:2], 2, 2)
