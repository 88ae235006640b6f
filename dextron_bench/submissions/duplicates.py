"""Recognises episodes that another method on the board has too, by the hashes of their actions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from dextron_bench.evaluation.results import Result, SplitScores
from dextron_bench.runs import result_files

MANY = 0.5  # A larger share of equal episodes makes a seed a copy.


def copied_seeds(results: Mapping[int, Result], name: str, board: Path) -> Iterator[str]:
    """A line for each seed and split whose episodes mostly equal the episodes of another method on the board."""
    for other in result_files.results(board / "results"):
        if other.method == name:
            continue
        for seed, result in results.items():
            if result.reaches != other.reaches:
                continue
            for split, (same, rows) in _equal_rows(result.splits, other.splits).items():
                if same > MANY * rows:
                    yield (
                        f"seed{seed}: {same} of {rows} episodes on {split} have exactly the actions of "
                        f"{other.method!r}, seed {other.seed}"
                    )


def all_equal(results: Mapping[int, Result]) -> bool:
    """True if all seeds act the same in every episode, as a method without random numbers does."""
    actions = [[split.actions for split in result.splits.values()] for result in results.values()]
    return all(seed_actions == actions[0] for seed_actions in actions)


def _equal_rows(splits: dict[str, SplitScores], other_splits: dict[str, SplitScores]) -> dict[str, tuple[int, int]]:
    """For each split in both results: the number of rows with equal actions, and the number of rows."""
    counts = {}
    for name in splits.keys() & other_splits.keys():
        hashes, other_hashes = (scores[name].actions or () for scores in (splits, other_splits))
        if pairs := list(zip(hashes, other_hashes, strict=False)):
            counts[name] = sum(first == second for first, second in pairs), len(pairs)
    return counts
