"""Splits: damaged files raise, and the shipped splits have the documented properties."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import policies
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.reaches.setting import OFFSET, Source
from dextron_bench.reaches.sources import open_source
from dextron_bench.splits import building, building_minjerk
from dextron_bench.splits.building import SETTING
from dextron_bench.splits.loading import (
    DamagedSplit,
    Split,
    UnknownSplit,
    all_splits,
    known_splits,
    load_split,
    ranking_splits,
    split_digest,
)
from tests.helpers import tiny_benchmark

SHIPPED = all_splits()
SOURCES = sorted({reaches for reaches, _ in SHIPPED})
each_split = pytest.mark.parametrize(("reaches", "name"), SHIPPED)
each_source = pytest.mark.parametrize("reaches", SOURCES)
GAINS = {"minjerk": (2.0, 2.0)}  # Its one expert; table I elsewhere.


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of tiny splits that replace the shipped ones."""
    tiny_benchmark.install(tiny_benchmark.write(tmp_path / "data"), monkeypatch.setattr)
    yield tmp_path / "data"
    tiny_benchmark.forget()


def table(folder: Path) -> pd.DataFrame:
    return pd.read_parquet(folder / "splits-synthetic.parquet")


def replace(folder: Path, rows: pd.DataFrame) -> None:
    """Replaces the rows without their hashes."""
    rows.to_parquet(folder / "splits-synthetic.parquet")


def complaint() -> str:
    with pytest.raises(DamagedSplit) as caught:
        load_split("synthetic", "test")
    assert "\n" not in str(caught.value)
    assert "'synthetic'" in str(caught.value)
    assert "reinstall the package" in str(caught.value)
    return str(caught.value)


def test_a_split_has_its_rows_in_order(folder: Path):
    split = load_split("synthetic", "test")
    assert [case.setting.reach for case in split.cases] == ["a", "b"]
    assert split.cases[0].expert == policies.Expert(1.4684286438473184, 0.2672967412483991)
    assert split.cases[0].window == 0.1
    assert split.digest == split_digest(tiny_benchmark.ROWS[tiny_benchmark.ROWS["split"] == "test"])


def test_names_are_in_a_fixed_order_and_only_some_splits_rank(folder: Path):
    assert known_splits("synthetic") == ("val", "test", "unseen-reach", "open")
    assert ranking_splits("synthetic") == ("test", "unseen-reach")
    assert all_splits() == [("synthetic", name) for name in known_splits("synthetic")]


def test_an_unknown_name_lists_the_valid_ones(folder: Path):
    with pytest.raises(UnknownSplit) as caught:
        load_split("synthetic", "tset")
    assert str(caught.value) == ("no split 'tset' of 'synthetic' reaches; choose from val, test, unseen-reach, open")


def test_a_source_without_splits_raises(folder: Path):
    with pytest.raises(UnknownSplit, match="of 'real' reaches; none ships"):
        ranking_splits("real")


@pytest.mark.parametrize("column", tiny_benchmark.COLUMNS[1:])
def test_any_changed_number_or_name_raises(folder: Path, column: str):
    rows = table(folder)
    values = rows[column].tolist()
    values[2] = "a" if column == "reach" else float(np.nextafter(values[2], 9.0))
    rows[column] = values
    replace(folder, rows)
    assert "split 'test'" in complaint()
    assert len(load_split("synthetic", "val").cases) == 1  # The other splits are not damaged.


def test_a_missing_an_added_and_a_moved_row_raise(folder: Path):
    whole = table(folder)
    for rows in (whole.drop(index=1), pd.concat([whole, whole.iloc[[1]]]), whole.iloc[[0, 2, 1, 3, 4]]):
        replace(folder, rows)
        tiny_benchmark.forget()
        assert "split 'test'" in complaint()


@pytest.mark.parametrize("column", ["split", "reach", "window"])
def test_a_missing_column_raises(folder: Path, column: str):
    replace(folder, table(folder).drop(columns=column))
    assert f"lack '{column}'" in complaint()


def test_a_cut_and_a_missing_file_raise(folder: Path):
    file = folder / "splits-synthetic.parquet"
    file.write_bytes(file.read_bytes()[:-40])
    assert "cannot be read" in complaint()
    file.unlink()
    assert "cannot be read" in complaint()


@pytest.mark.parametrize("text", ["{", ""])
def test_a_damaged_catalogue_raises(folder: Path, text: str):
    (folder / "splits.json").write_text(text)
    with pytest.raises(DamagedSplit, match="catalogue of splits cannot be read"):
        known_splits("synthetic")


# Shipped splits.


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


@each_source
def test_no_setting_is_near_equal_to_a_setting_of_another_split(shipped: dict, reaches: str):
    train = settings(shipped[reaches, "train"])
    for name in known_splits(reaches):
        if name != "train":
            remaining = building.without_near_equal(train, settings(shipped[reaches, name]))
            assert len(remaining) == len(train), f"{name} is near train"
    for name in ranking_splits(reaches):
        val = settings(shipped[reaches, "val"])
        assert len(building.without_near_equal(val, settings(shipped[reaches, name]))) == len(val), (
            f"{name} is near val"
        )


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


@each_split
def test_every_source_has_the_reaches_of_its_splits(
    shipped: dict, reaches: str, name: str, opened: Callable[[str], Source]
):
    source = opened(reaches)
    for reach in set(settings(shipped[reaches, name])["reach"]):
        source.stratum(reach)  # Raises UnknownReach; minjerk lists only some of its reaches.


@pytest.mark.slow
@each_split
def test_experts_replay_at_exactly_20(shipped: dict, reaches: str, name: str, opened: Callable[[str], Source]):
    if name == "open":
        pytest.skip("its rows may be unsolvable")
    cases = shipped[reaches, name].cases[:: 8 if name == "train" else 1]  # leaderboard/results/exp has all rows.
    played = dict(rollout(ExpertAgent(), opened(reaches), cases))
    assert [played[index].score for index in range(len(cases))] == [20.0] * len(cases)
