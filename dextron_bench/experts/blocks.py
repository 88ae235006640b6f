"""The folder of a search: one file per block of draws, and the counts over all blocks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.storage import folder_config, schemas, tables
from dextron_bench.storage.folders import visible
from dextron_bench.world import model, task

SEARCH = "search.json"  # The search that the folder belongs to.
KEPT = 1.0  # Rows with a sum of rewards above this are kept (paper, II.C).


class DamagedBlock(ValueError):
    """A block of a search that cannot be used; the message names it and says what to do."""

    def __init__(self, file: Path, why: object) -> None:
        super().__init__(f"{file} is damaged ({why}); remove it and search again")


@dataclass(frozen=True, slots=True)
class Tally:
    """The progress of a search: finished blocks, draws tried, rows kept, rows with all 20 rewards."""

    blocks: int
    draws: int
    kept: int
    solved: int


def write_or_check(search: dict[str, Any], folder: Path) -> None:
    """Writes the search into a new folder; raises FolderMismatch if the folder holds another search."""
    config = {"search": search, "physics": model.mjcf_hash()}
    folder_config.write_or_check_file(folder / SEARCH, config, "search", "choose another folder, or remove it")


def read_config(folder: Path) -> dict[str, Any]:
    """The search that a folder holds, and the hash of its physics; empty if it holds none."""
    file = folder / SEARCH
    return schemas.read(file, schemas.SEARCH) if file.exists() else {}


def write(folder: Path, number: int, draws: pd.DataFrame) -> None:
    """Writes the file of a block atomically."""
    tables.write(block_file(folder, number), draws, compression="zstd")


def block_file(folder: Path, number: int) -> Path:
    """The file of a block."""
    return folder / "blocks" / f"{number:06d}.parquet"


def update_tallies(folder: Path, done: dict[int, Tally]) -> dict[int, Tally]:
    """The tallies of all blocks in the folder; reads only the blocks that are not in `done`."""
    stored = [int(file.stem) for file in visible(folder / "blocks", "[0-9]*.parquet") if file.stem.isdecimal()]
    return {number: done.get(number) or _tally(read(block_file(folder, number))) for number in stored}


def read(file: Path) -> pd.DataFrame:
    """A block's draws with their outcomes; raises DamagedBlock."""
    try:
        return tables.read(file, tables.DRAWS)
    except tables.BadTable as error:
        raise DamagedBlock(file, error) from error


def check(file: Path, block: pd.DataFrame, draws: pd.DataFrame) -> None:
    """Raises DamagedBlock if a block does not hold exactly these draws, in their order."""
    if len(block) != len(draws):
        raise DamagedBlock(file, f"it has {len(block)} rows, and a block of this search has {len(draws)}")
    if differing := [name for name in draws if (block[name].to_numpy() != draws[name].to_numpy()).any()]:
        raise DamagedBlock(file, f"its column {differing[0]!r} differs from the draws of this search")


def total(done: dict[int, Tally]) -> Tally:
    """The sum of the tallies of blocks."""
    parts = done.values()
    return Tally(len(done), sum(t.draws for t in parts), sum(t.kept for t in parts), sum(t.solved for t in parts))


def last_block_needed(done: dict[int, Tally], rows: int) -> int | None:
    """The first block up to which blocks 0, 1, ... hold `rows` solved rows together; None if they hold fewer."""
    solved = number = 0
    while number in done:
        solved += done[number].solved
        if solved >= rows:
            return number
        number += 1
    return None


def _tally(draws: pd.DataFrame) -> Tally:
    score = draws["score"]
    return Tally(1, len(score), int((score > KEPT).sum()), int((score == task.SUCCESS).sum()))
