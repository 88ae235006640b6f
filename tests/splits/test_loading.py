"""Splits: damaged files raise, and the shipped splits have the documented properties."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dextron_bench.errors import BadInput
from dextron_bench.experts import policies
from dextron_bench.splits.loading import (
    UnknownSplit,
    all_splits,
    known_splits,
    load_split,
    ranking_splits,
    split_digest,
)
from tests.helpers import tiny_benchmark


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
    with pytest.raises(BadInput) as caught:
        load_split("synthetic", "test")
    assert "\n" not in str(caught.value)
    assert "'synthetic'" in str(caught.value)
    assert "reinstall the package" in str(caught.value)
    return str(caught.value)


def test_a_split_has_its_rows_in_order(folder: Path):
    split = load_split("synthetic", "test")
    assert [case.setting.reach for case in split.cases] == ["a", "b"]
    assert split.cases[0].expert == policies.Expert(1.211950160077924, 0.2662680106143978)
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
    with pytest.raises(BadInput, match="catalogue of splits cannot be read"):
        known_splits("synthetic")


# Shipped splits.


@pytest.mark.parametrize(
    ("reaches", "name"), [("synthetic", None), (None, "test"), (["synthetic"], "test"), ("real", 3)]
)
def test_names_that_are_no_texts_are_unknown(reaches: Any, name: Any) -> None:
    with pytest.raises(UnknownSplit, match="no split"):
        load_split(reaches, name)
