"""A frozen random order of a split's rows, the same for every method and on every machine."""

from __future__ import annotations

from dextron_bench.splits.loading import Split
from dextron_bench.storage import hashing


def random_order(split: Split) -> list[int]:
    """All row numbers of a split, sorted by the hash of the split's digest and the row."""
    return sorted(range(len(split)), key=lambda row: hashing.digest(f"{split.digest} {row}".encode()))
