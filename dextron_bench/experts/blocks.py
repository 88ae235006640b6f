"""The folder of a search: one file per block of draws, and the counts over all blocks."""

from __future__ import annotations

import functools
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.storage import atomic, folder_config, hashing, provenance, records, shares, tables
from dextron_bench.storage.folders import visible
from dextron_bench.storage.provenance import Provenance
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


def write(folder: Path, number: int, draws: pd.DataFrame) -> None:
    """Writes the file of a block atomically."""
    tables.write(block_file(folder, number), draws, compression="zstd")


def work(folder: Path) -> shares.Work:
    """The search of a folder, for processes that do a share of it."""
    return shares.Work(folder, provenance.code_hash())


def read_pieces(search: dict[str, Any], folder: Path) -> dict[str, shares.Piece]:
    """The blocks that shares of a search have played, checked; raises the errors of `shares.Work.read`."""
    return work(folder).read(lambda name: piece_config(search))


def piece_config(search: dict[str, Any]) -> dict[str, Any]:
    """What a block depends on, besides its number."""
    return {"search": search, "physics": model.mjcf_hash()}


def write_piece(search: dict[str, Any], folder: Path, number: int, draws: pd.DataFrame) -> list[Path]:
    """Writes a block as a piece of a share; returns its file and its stamp."""
    file = work(folder).file(_name(number), ".parquet")
    tables.write(file, draws, compression="zstd")
    return [file, work(folder).write(_name(number), piece_config(search), [file])]


def take_pieces(search: dict[str, Any], folder: Path) -> None:
    """Puts the blocks of shares among the blocks of the search, and their makers into its provenance.

    Raises DamagedBlock if a block differs from the one that is there, and the errors of `shares.Work.read`.
    """
    if not (pieces := read_pieces(search, folder)):
        return
    add_makers(folder, [piece.provenance for piece in pieces.values()])
    for name, piece in pieces.items():
        file, (source, sha256) = block_file(folder, int(name)), next(iter(piece.files.items()))
        if not file.exists():
            atomic.write_atomically(file, functools.partial(shutil.copyfile, source))
        elif hashing.sha256(file) != sha256:
            raise DamagedBlock(file, f"it differs from {source}, which is the same block")
    work(folder).remove(pieces.values())


def add_makers(folder: Path, makers: list[Provenance]) -> None:
    """Adds to the provenance of a search. Blocks that were there before count as made by this process."""
    file = folder / PROVENANCE
    if file.exists() or update_tallies(folder, {}):
        makers = [*makers, read_makers(folder)]
    atomic.write_json(file, provenance.merged(makers))


def read_makers(folder: Path) -> Provenance:
    """The provenance of a search: this process, if no shares have worked on it. Raises DamagedFile."""
    file = folder / PROVENANCE
    return records.read(file, Provenance) if file.exists() else provenance.collect(model.mjcf_hash())


def block_file(folder: Path, number: int) -> Path:
    """The file of a block."""
    return folder / "blocks" / f"{_name(number)}.parquet"


def _name(number: int) -> str:
    return f"{number:06d}"


def update_tallies(folder: Path, done: dict[int, Tally], pieces: bool = False) -> dict[int, Tally]:
    """The tallies of all blocks in the folder, with `pieces` also of shares; reads only blocks that are not in `done`.

    Raises DamagedBlock.
    """
    stored = {int(file.stem): file for file in visible(folder / "blocks", "[0-9]*.parquet") if file.stem.isdecimal()}
    if pieces:
        stamps = [file for file in visible(folder / shares.FOLDER, "*.json") if file.stem.isdecimal()]
        stored = {int(file.stem): file.with_suffix(".parquet") for file in stamps} | stored
    return {number: done.get(number) or _tally(read(file)) for number, file in sorted(stored.items())}


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
