"""The splits that ship: ranges, held-out reaches and subjects, and experts that replay at exactly 20."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import policies
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.reaches.setting import OFFSET, Source
from dextron_bench.reaches.sources import open_source
from dextron_bench.splits import building_minjerk
from dextron_bench.splits.loading import (
    Split,
    all_splits,
    known_splits,
    load_split,
    ranking_splits,
)
from dextron_bench.splits.near_equal import SETTING, without_near_equal
from tests.helpers import tiny_benchmark

SHIPPED = all_splits()
SOURCES = sorted({reaches for reaches, _ in SHIPPED})
each_split = pytest.mark.parametrize(("reaches", "name"), SHIPPED)
each_source = pytest.mark.parametrize("reaches", SOURCES)
GAINS = {"minjerk": (2.0, 2.0)}  # Its one expert; table I elsewhere.


@pytest.fixture(scope="module")
def shipped() -> dict[tuple[str, str], Split]:
    tiny_benchmark.forget()
    return {names: load_split(*names) for names in SHIPPED}


def settings(split: Split) -> pd.DataFrame:
    """The settings of a split as a table with the columns SETTING."""
    rows = [(s.reach, s.offset_x, s.offset_y, s.duration_noise) for s in (case.setting for case in split.cases)]
    return pd.DataFrame(rows, columns=SETTING)


@each_split
def test_numbers_are_within_the_ranges_of_the_paper(shipped: dict, reaches: str, name: str):
    cases = shipped[reaches, name].cases
    rows = settings(shipped[reaches, name])
    numbers = rows[SETTING[1:]].to_numpy()
    gains, criticals = np.array([(case.expert.gain, case.expert.critical) for case in cases]).T
    windows = np.array([case.window for case in cases])
    assert np.isfinite(numbers).all()
    assert (np.abs(numbers[:, :2]) <= OFFSET).all()
    assert (np.abs(numbers[:, 2]) < 6.0).all()  # Standard normal.
    low, high = GAINS.get(reaches, policies.GAIN)
    assert ((gains >= low) & (gains <= high)).all()
    assert ((criticals >= 0.01) & (criticals <= 0.9)).all()
    assert ((windows >= 0.0) & (windows <= 0.89)).all()


@each_split
def test_the_scan_misses_few_solved_rows(shipped: dict, reaches: str, name: str):
    """Each row has a successful expert, but the scan, with a grid of 0.056, may miss a range that is narrower.

    The windows of `train` come from the search, which tried the row's own expert, so none is missed.
    """
    windows = np.array([case.window for case in shipped[reaches, name].cases])
    if name == "open":
        assert 0.5 < (windows == 0.0).mean() <= 1.0  # Most uniform settings cannot be solved.
    elif len(windows) >= 50:
        assert (windows == 0.0).mean() < 0.35


@each_split
def test_all_splits_except_train_have_different_rows(shipped: dict, reaches: str, name: str):
    rows = settings(shipped[reaches, name])
    if name != "train":  # `train` has one row per expert of a setting.
        assert not rows.duplicated().any()


@pytest.mark.slow
@each_source
def test_no_setting_is_near_equal_to_a_setting_of_another_split(shipped: dict, reaches: str):
    train = settings(shipped[reaches, "train"])
    for name in known_splits(reaches):
        if name != "train":
            remaining = without_near_equal(train, settings(shipped[reaches, name]))
            assert len(remaining) == len(train), f"{name} is near train"
    for name in ranking_splits(reaches):
        val = settings(shipped[reaches, "val"])
        assert len(without_near_equal(val, settings(shipped[reaches, name]))) == len(val), f"{name} is near val"


@each_source
def test_held_out_reaches_and_subjects_occur_nowhere_else(shipped: dict, reaches: str, opened: Callable[[str], Source]):
    if reaches == "minjerk":
        pytest.skip("every reach of minjerk occurs once")
    seen = {name: set(settings(shipped[reaches, name])["reach"]) for name in ("train", "val", "test")}
    held_out = {name: set(settings(split)["reach"]) for (r, name), split in shipped.items() if r == reaches}
    for names in seen.values():
        assert not names & held_out["unseen-reach"]
    if "unseen-subject" in held_out:
        source = opened(reaches)
        subjects = {source.stratum(reach).subject for reach in held_out["unseen-subject"]}
        others = set.union(*seen.values(), held_out["unseen-reach"])
        assert len(subjects) <= 2
        assert not subjects & {source.stratum(reach).subject for reach in others}


def test_minjerk_has_each_reach_once_and_trains_on_the_listed_ones(shipped: dict):
    if "minjerk" not in SOURCES:
        pytest.skip("no splits of minjerk ship")
    assert known_splits("minjerk") == ("train", "val", "test")
    assert ranking_splits("minjerk") == ("test",)
    reaches = {name: settings(shipped["minjerk", name])["reach"] for name in known_splits("minjerk")}
    assert not pd.concat(reaches.values()).duplicated().any()
    listed = open_source("minjerk").names
    assert {name: rows.isin(listed).mean() for name, rows in reaches.items()} == {"train": 1.0, "val": 0.0, "test": 0.0}
    assert {case.expert for name in reaches for case in shipped["minjerk", name].cases} == {building_minjerk.EXPERT}


@pytest.mark.slow
@each_split
def test_every_source_has_the_reaches_of_its_splits(
    shipped: dict, reaches: str, name: str, opened: Callable[[str], Source]
):
    source = opened(reaches)
    for reach in set(settings(shipped[reaches, name])["reach"]):
        source.stratum(reach)  # Raises UnknownReach; minjerk lists only some of its reaches.


@pytest.mark.slow
@each_split
def test_experts_replay_at_exactly_20(
    shipped: dict, reaches: str, name: str, opened: Callable[[str], Source], thorough: bool
):
    """About fifteen rows of each split, every one with `--thorough`; the published results of EXP have all rows."""
    if name == "open":
        pytest.skip("its rows may be unsolvable")
    rows = shipped[reaches, name].cases
    cases = rows if thorough else rows[:: max(1, len(rows) // 15)]
    played = dict(rollout(ExpertAgent(), opened(reaches), cases))
    assert [played[index].score for index in range(len(cases))] == [20.0] * len(cases)
