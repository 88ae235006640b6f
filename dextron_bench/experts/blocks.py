"""The folder of a search: one file per block of draws, and the counts over all blocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.storage import folder_config, provenance, schemas, tables
from dextron_bench.world import model, task

SEARCH = "search.json"  # The search that the folder belongs to.
PROVENANCE = "provenance.json"  # What made the blocks, if shares have worked on the search.
KEPT = 1.0  # Rows with a sum of rewards above this are kept (paper, II.C).


class DamagedBlock(ValueError):
    """A block of a search that cannot be used; the message names it and says what to do."""

    def __init__(self, file: Path, why: object) -> None:
        super().__init__(f"{file} is damaged ({why}); remove it and search again")


class ForeignBlock(DamagedBlock):
    """A block that can be read, but is not one that this version writes for the search."""

    def __init__(self, file: Path, why: object) -> None:
        advice = "move it away and search again, or search in another folder"
        ValueError.__init__(self, f"{file} is not of this search or of another version ({why}); {advice}")


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


def read_makers(folder: Path) -> dict[str, Any]:
    """The provenance of a search: this process, if no shares have worked on it. Raises DamagedFile."""
    file = folder / PROVENANCE
    return schemas.read(file, schemas.PROVENANCE) if file.exists() else provenance.collect(model.mjcf_hash())


def update_tallies(files: Mapping[int, Path], done: Mapping[int, Tally]) -> dict[int, Tally]:
    """The tallies of blocks by number, from their files; reads only blocks that are not in `done`.

    Raises DamagedBlock.
    """
    return {number: done.get(number) or _tally(read(file)) for number, file in sorted(files.items())}


def read(file: Path) -> pd.DataFrame:
    """A block's draws with their outcomes; raises DamagedBlock."""
    try:
        return tables.read(file, tables.DRAWS)
    except tables.OtherColumns as error:
        raise ForeignBlock(file, error) from error
    except tables.BadTable as error:
        raise DamagedBlock(file, error) from error


def check(file: Path, block: pd.DataFrame, draws: pd.DataFrame) -> None:
    """Raises ForeignBlock if a block does not hold exactly these draws, in their order."""
    if len(block) != len(draws):
        raise ForeignBlock(file, f"it has {len(block)} rows, and a block of this search has {len(draws)}")
    if differing := [name for name in draws if (block[name].to_numpy() != draws[name].to_numpy()).any()]:
        raise ForeignBlock(file, f"its column {differing[0]!r} differs from the draws of this search")


def total(done: Mapping[int, Tally]) -> Tally:
    """The sum of the tallies of blocks."""
    parts = done.values()
    return Tally(len(done), sum(t.draws for t in parts), sum(t.kept for t in parts), sum(t.solved for t in parts))


def _tally(draws: pd.DataFrame) -> Tally:
    score = draws["score"]
    return Tally(1, len(score), int((score > KEPT).sum()), int((score == task.SUCCESS).sum()))
