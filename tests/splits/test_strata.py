"""The strata of a split are the strata of its reaches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from dextron_bench.reaches.setting import Source
from dextron_bench.splits.loading import all_splits, load_split
from dextron_bench.splits.strata import REGION, SUBJECT, by_stratum, by_subject, start_regions, strata


@pytest.mark.parametrize(("reaches", "split"), [(r, s) for r, s in all_splits() if s == "test"])
def test_strata_equal_the_strata_of_the_source(reaches: str, split: str, opened: Callable[[str], Source]):
    loaded, source = load_split(reaches, split), opened(reaches)
    of_rows = [source.stratum(case.setting.reach) for case in loaded.cases]
    expected = [(stratum.subject, stratum.ring, stratum.angle) for stratum in of_rows]
    assert list(strata(loaded).itertuples(index=False, name=None)) == expected


def test_the_name_of_a_recorded_reach_gives_subject_and_region():
    """Marker 11 is the third on the third ring of four."""
    split = load_split("real", "test")
    row = next(i for i, case in enumerate(split.cases) if case.setting.reach.endswith("_11"))
    stratum = strata(split).iloc[row]
    assert (stratum["subject"], stratum["ring"], stratum["angle"]) == (split.cases[row].setting.reach[:2], 2, 2)


def test_a_group_has_the_means_over_seeds_and_rows():
    """Rows 0 and 2 belong to one subject: seed 0 scores 20 and 10, seed 1 scores 0 and 20."""
    rows = pd.DataFrame({"subject": ["x", "y", "x"], "ring": [0, 0, 3], "angle": [1, 1, 2]})
    scores = np.array([[20.0, 4.0, 10.0], [0.0, 4.0, 20.0]])
    of_subjects = by_stratum(scores, rows, SUBJECT)
    assert of_subjects.to_dict("list") == {
        "subject": ["x", "y"],
        "rows": [2, 1],
        "return": [12.5, 4.0],
        "success": [0.5, 0.0],
    }
    by_region = by_stratum(scores, rows, REGION)
    assert by_region[["ring", "angle", "rows", "return"]].to_numpy().tolist() == [[0, 1, 2, 7.0], [3, 2, 1, 15.0]]


def test_regions_are_numbered_by_ring_then_angle():
    split = load_split("real", "test")
    rows = strata(split)
    numbers = start_regions("real", "test", split.digest)
    assert numbers is not None
    assert numbers.tolist() == [4 * ring + angle for ring, angle in zip(rows["ring"], rows["angle"], strict=True)]


@pytest.mark.parametrize(
    ("reaches", "name"), [("real", "test"), ("real", "nowhere"), ("minjerk", "test+bottle-friction")]
)
def test_a_split_that_does_not_ship_has_no_regions(reaches: str, name: str):
    assert start_regions(reaches, name, "0" * 64) is None


def test_a_subject_is_separated_from_the_others_row_by_row():
    """The first two digits of a recorded reach name its subject."""
    split = load_split("real", "val")
    subject = split.cases[0].setting.reach[:2]
    held_out, others = by_subject(split, subject)
    assert {case.setting.reach[:2] for case in held_out.cases} == {subject}
    assert subject not in {case.setting.reach[:2] for case in others.cases}
    assert list(held_out.cases) == [case for case in split.cases if case.setting.reach.startswith(subject)]
    assert len(held_out.cases) + len(others.cases) == len(split.cases)
    assert len({split.digest, held_out.digest, others.digest}) == 3
