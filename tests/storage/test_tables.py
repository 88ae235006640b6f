"""Tables: columns that are missing, of another kind or changed after writing are noticed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dextron_bench.storage import tables

TABLE = pd.DataFrame(
    {
        **{"reach": ["a", "b"], "offset_x": [0.0, 0.1], "offset_y": [0.0, 0.2], "duration_noise": [0.0, -1.0]},
        **{"gain": [1.0, 1.2], "critical": [0.1, 0.2], "score": [20.0, 0.0], "length": [40, np.nan]},
    }
)


def refusal(file: Path) -> str:
    with pytest.raises(tables.BadTable) as caught:
        tables.read(file, tables.DRAWS)
    return str(caught.value)


def test_a_table_is_read_as_it_was_written_and_equal_tables_give_equal_bytes(tmp_path: Path):
    for name in "ab":
        tables.write(tmp_path / name, TABLE)
    pd.testing.assert_frame_equal(tables.read(tmp_path / "a", tables.DRAWS), TABLE)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert TABLE.attrs == {}


def test_a_table_of_an_earlier_version_without_a_digest_is_read(tmp_path: Path):
    TABLE.to_parquet(tmp_path / "a")
    pd.testing.assert_frame_equal(tables.read(tmp_path / "a", tables.DRAWS), TABLE)


def test_lists_and_missing_values_are_part_of_the_digest(tmp_path: Path):
    table = pd.DataFrame({"actions": [np.array([0.1, 0.2]), np.array([])], "lag": [None, 0.5], "none": [None, None]})
    tables.write(tmp_path / "a", table)
    assert tables.digest(tables.read(tmp_path / "a", {})) == tables.digest(table)
    assert tables.digest(table.assign(actions=pd.Series([np.array([0.1]), np.array([0.2])]))) != tables.digest(table)


@pytest.mark.parametrize("name", list(TABLE))
def test_a_table_without_a_column_is_refused(tmp_path: Path, name: str):
    tables.write(tmp_path / "a", TABLE.drop(columns=name))
    assert refusal(tmp_path / "a") == f"it lacks the column {name!r}"


@pytest.mark.parametrize(
    ("name", "values"),
    [
        *[("score", [20.0, wrong]) for wrong in (np.nan, np.inf, -5.0, 1e308)],
        *[("score", ["20", "0"]), ("reach", ["a", None]), ("reach", [1, 2]), ("gain", [np.inf, 1.0])],
        *[("length", ["40", "41"]), ("length", [np.inf, 1.0])],
    ],
)
def test_values_that_do_not_belong_in_a_column_are_refused(tmp_path: Path, name: str, values: list[Any]):
    tables.write(tmp_path / "a", TABLE.assign(**{name: values}))
    assert refusal(tmp_path / "a") == f"its column {name!r} has values that do not belong there"


def test_a_value_that_was_changed_after_writing_is_noticed(tmp_path: Path):
    tables.write(tmp_path / "a", TABLE)
    changed = pd.read_parquet(tmp_path / "a")  # Its attributes hold the digest.
    changed.loc[1, "score"] = 20.0
    changed.to_parquet(tmp_path / "a")
    assert refusal(tmp_path / "a") == "its values differ from the digest that it carries"


def test_a_table_that_is_cut_is_refused(tmp_path: Path):
    tables.write(tmp_path / "a", TABLE)
    content = (tmp_path / "a").read_bytes()
    for length in (0, 3, len(content) // 2, len(content) - 1):
        (tmp_path / "a").write_bytes(content[:length])
        assert refusal(tmp_path / "a")


def test_a_lack_of_memory_or_of_a_permission_is_no_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for error in (MemoryError("malloc"), PermissionError(13, "Permission denied"), OSError(5, "Input/output error")):

        def fail(_: Path, error: Exception = error) -> None:
            raise error

        monkeypatch.setattr(tables.pd, "read_parquet", fail)
        with pytest.raises(type(error)):
            tables.read_own(tmp_path / "a.parquet", tables.EPISODES)
