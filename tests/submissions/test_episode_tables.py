"""Tables of episodes from strangers: a table that no run writes is refused with the reason."""

from __future__ import annotations

import resource

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pandas.testing import assert_frame_equal

from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.submissions import episode_tables, table_process
from dextron_bench.submissions.bundle import BadBundle
from tests.helpers import tiny_benchmark
from tests.helpers.forged_bundles import Forgery, row


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda table: table.assign(row=table["row"].astype("Int64").where(table.index > 0)), "without its row"),
        (row(1, split=None), "without its split"),
        (row(1, actions=None), "without its actions"),
        (row(1, final=[0.0] * 47), "a last state without exactly 48 numbers"),
        (row(1, failure="x" * 2_000_000), "has texts of 20000"),
        (row(1, failure="\x1b]0;mine\x07"), r"has the character '\x1b' in column 'failure'"),
        (lambda table: table.drop(columns="trace"), "it lacks b'trace'"),
        (lambda table: table.drop(columns="score"), "differs in 'score'"),
        (lambda table: table.assign(more=1), "differs in 'more'"),
        (lambda table: table.assign(score="20"), "string in column 'score'"),
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
    monkeypatch.setattr("dextron_bench.submissions.episode_tables.GROUPS", 3)
    pq.write_table(pq.read_table(file), file, row_group_size=1)
    assert "has 4 row groups, more than 3" in forged.checked().problems[0]


def test_a_file_that_is_not_a_table_is_refused(forged: Forgery):
    (forged.seed / "episodes.parquet").write_bytes(b"PAR1 nothing PAR1")
    assert "cannot be read as a table" in forged.checked().problems[0]


def test_a_long_text_is_refused(forged: Forgery):
    forged.table(row(2, failure="x" * 5000))
    assert "has texts of more than 1000 characters in column 'failure'" in forged.checked().problems[0]


def test_a_footer_with_a_false_count_fills_no_memory(forged: Forgery, monkeypatch: pytest.MonkeyPatch):
    """A reader that asks for 3 GB ends; the footer of a real table makes it do so with a few bytes."""
    script = forged.seed / "hungry.py"
    script.write_text("def main(*_): b'x' * (3 << 30)")
    monkeypatch.setattr(table_process, "__file__", str(script))
    with pytest.raises(BadBundle, match="cannot be read as a table"):
        episode_tables.read(forged.seed / "episodes.parquet", [])


def test_a_table_that_takes_too_long_is_refused(forged: Forgery, monkeypatch: pytest.MonkeyPatch):
    script = forged.seed / "slow.py"
    script.write_text("def main(*_):\n  while True: pass")
    monkeypatch.setattr(table_process, "__file__", str(script))
    monkeypatch.setattr(episode_tables, "SECONDS", 0.5)
    with pytest.raises(BadBundle, match="the process that read it took too long"):
        episode_tables.read(forged.seed / "episodes.parquet", [])


@pytest.mark.slow
def test_a_table_with_a_changed_footer_is_refused_or_equal(forged: Forgery):
    """The memory of the reader stays below its limit, whatever count the bytes state."""
    file = forged.seed / "episodes.parquet"
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    content = file.read_bytes()
    length = int.from_bytes(content[-8:-4], "little")
    splits = [load_split(tiny_benchmark.NAME, name) for name in ranking_splits(tiny_benchmark.NAME)]
    whole, refused = episode_tables.read(file, splits), 0
    for place in range(12):
        changed = bytearray(content)
        spot = len(content) - 8 - length + place * length // 12
        changed[spot : spot + 5] = b"\xfe\xff\xff\xff\x0f"  # A large number as Thrift writes it.
        file.write_bytes(changed)
        try:
            assert_frame_equal(episode_tables.read(file, splits), whole)
        except BadBundle:
            refused += 1
    assert refused >= 6
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss <= max(before, 1_500_000)  # [kB]
