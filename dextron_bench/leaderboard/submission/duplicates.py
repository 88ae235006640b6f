"""Episodes under one name that are another's: known by the hashes of their actions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dextron_bench.runs import result_files

MANY = 0.5  # The share of equal episodes from which a submission counts as another's.


def copied_seeds(results: Mapping[int, dict[str, Any]], name: str, board: Path) -> Iterator[str]:
    """A line for each seed of results most of whose episodes on a split are those of another name's on the board."""
    for other in result_files.results(board / "results"):
        if other["method"] == name:
            continue
        for seed, result in results.items():
            if result["reaches"] != other["reaches"]:
                continue
            for split, (same, rows) in _equal(result["splits"], other["splits"]).items():
                if same > MANY * rows:
                    yield (
                        f"seed{seed}: {same} of {rows} episodes on {split} have the very actions of "
                        f"{other['method']!r}, seed {other['seed']}"
                    )


def all_equal(results: Mapping[int, dict[str, Any]]) -> bool:
    """Whether all seeds acted the same in every episode, as a rule without chance does."""
    told = [[split.get("actions") for split in result["splits"].values()] for result in results.values()]
    return all(each == told[0] for each in told)


def _equal(own: dict[str, Any], others: dict[str, Any]) -> dict[str, tuple[int, int]]:
    """Rows of each split with equal actions, and all rows."""
    counts = {}
    for split in own.keys() & others.keys():
        pairs = list(zip(own[split].get("actions", []), others[split].get("actions", []), strict=False))
        if pairs:
            counts[split] = sum(a == b for a, b in pairs), len(pairs)
    return counts
