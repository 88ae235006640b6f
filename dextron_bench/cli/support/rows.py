"""The first rows of a split, as `--rows` says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dextron_bench.errors import BadInput

if TYPE_CHECKING:
    from dextron_bench.splits.loading import Split
    from dextron_bench.splits.rows import Rows


def first(split: Split, rows: int) -> Rows:
    """The first rows of a split; raises BadInput for fewer than one."""
    if rows < 1:
        raise BadInput(f"--rows must be 1 or more, not {rows}")
    return split.first(rows)
