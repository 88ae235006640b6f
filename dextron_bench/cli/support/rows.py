"""The first rows of a split, as `--rows` says."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dextron_bench.splits.loading import Split
    from dextron_bench.splits.rows import Rows


class NoRows(ValueError):
    """A number of rows below 1."""


def first(split: Split, rows: int) -> Rows:
    """The first rows of a split; raises NoRows for fewer than one."""
    if rows < 1:
        raise NoRows(f"--rows must be 1 or more, not {rows}")
    return split.first(rows)
