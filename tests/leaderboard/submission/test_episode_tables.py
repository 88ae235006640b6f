"""Tables of episodes from strangers: a table that no run writes is refused with the reason."""

from __future__ import annotations

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.helpers.forged_bundles import Forgery, row


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda table: table.assign(row=table["row"].astype("Int64").where(table.index > 0)), "without its row"),
        (row(1, split=None), "without its split"),
        (row(1, actions=None), "without its actions"),
        (row(1, final=[0.0] * 47), "a last state without exactly 48 numbers"),
        (row(1, failure="x" * 2_000_000), "has texts of 20000"),
        (lambda table: table.drop(columns="trace"), "it lacks b'trace'"),
        (lambda table: table.drop(columns="score"), "differs in 'score'"),
        (lambda table: table.assign(more=1), "differs in 'more'"),
        (lambda table: table.assign(score="20"), "has large_string in column 'score'"),
        (lambda table: pd.concat([table, table[:1]]), "has 5 episodes, but the splits have 4"),
    ],
)
def test_values_and_columns_that_no_run_writes_are_refused(change, reason: str, forged: Forgery):
    forged.table(change)
    assert reason in forged.checked().problems[0]


def test_duplicate_columns_are_refused(forged: Forgery):
    file = forged.seed / "episodes.parquet"
    table = pq.read_table(file)
    duplicated = pa.Table.from_arrays([*table.columns, table.column("split")], names=[*table.column_names, "split"])
    pq.write_table(duplicated, file)
    assert "differs in 'split'" in forged.checked().problems[0]


def test_more_row_groups_than_a_run_writes_are_refused(forged: Forgery, monkeypatch: pytest.MonkeyPatch):
    file = forged.seed / "episodes.parquet"
    monkeypatch.setattr("dextron_bench.leaderboard.submission.episode_tables.GROUPS", 3)
    pq.write_table(pq.read_table(file), file, row_group_size=1)
    assert "has 4 row groups, more than 3" in forged.checked().problems[0]


def test_a_file_that_is_not_a_table_is_refused(forged: Forgery):
    (forged.seed / "episodes.parquet").write_bytes(b"PAR1 nothing PAR1")
    assert "cannot be read as a table" in forged.checked().problems[0]


def test_a_long_text_is_refused(forged: Forgery):
    forged.table(row(2, failure="x" * 5000))
    assert "has texts of more than 1000 characters in column 'failure'" in forged.checked().problems[0]
