"""A search for experts in its folder: plays blocks of draws until enough rows have all 20 rewards (paper, II.C)."""

from __future__ import annotations

import functools
import itertools
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.experts import blocks, montecarlo, outcomes
from dextron_bench.experts.blocks import Tally
from dextron_bench.experts.montecarlo import Search
from dextron_bench.reaches.setting import Source
from dextron_bench.reaches.sources import open_source
from dextron_bench.storage import atomic, block_work, folder_config, hashing, provenance, tables
from dextron_bench.storage.block_work import BlockWork
from dextron_bench.storage.pieces import Place, Recipe
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world import model
from dextron_bench.world.engine import Engine


def open_work(place: Place, search: Search, rows: int) -> SearchWork:
    """A search in a folder, for `rows` solved rows; raises MissingData."""
    return SearchWork(search, place.folder, rows, open_source(search.reaches), Engine(montecarlo.SLOTS, place.threads))


@dataclass(frozen=True)
class SearchWork(BlockWork):
    """A search until `goal` rows are solved, which means that they have all 20 rewards, in a folder."""

    unit, what, suffix = "rows", "the search", ".parquet"

    search: Search
    place: Path
    goal: int
    source: Source
    engine: Engine
    _read: dict[int, Tally] = field(default_factory=dict, init=False, repr=False)  # Tallies of blocks, by number.

    def begin(self) -> None:
        """Writes the search into a new folder; raises FolderMismatch if the folder holds another search."""
        blocks.write_or_check(asdict(self.search), self.place)

    def config_of(self, name: str) -> dict[str, Any]:
        """What a block depends on, besides its number."""
        return {"search": asdict(self.search), "physics": model.mjcf_hash()}

    def recipe(self, name: str) -> Recipe:
        """How another process makes the same search."""
        return Recipe(open_work, {"search": self.search, "rows": self.goal}, self.search.reaches)

    def amounts(self) -> dict[int, int]:
        """How many rows are solved in each block, also in pieces; raises DamagedBlock."""
        return {number: tally.solved for number, tally in self._tallies(self.block_files()).items()}

    def play_blocks(self, numbers: Iterable[int]) -> Iterator[list[Path]]:
        """Plays blocks as pieces, the next ones while the last end; yields the files of each, the stamp last."""
        for number, draws in self._played(numbers):
            name = block_work.name_of(number)
            tables.write(file := self.file(name, self.suffix), draws, compression="zstd")
            yield self.complete(name, [file])

    def run(self, progress: Progress = no_progress) -> pd.DataFrame:
        """Searches, or continues, until the goal is reached; returns every draw with its outcome, in order.

        Columns: the columns of `montecarlo.draw`, then `score` (sum of rewards) and `length` [control steps]. Blocks of
        shares are checked, and become blocks of the search. Calls `progress` with the number of solved rows, and the
        goal. Raises FolderMismatch if the folder holds another search, DamagedBlock, and the errors of `stored`.
        """
        self.begin()
        self._take_pieces()
        done = self._tallies(self.block_files(pieces=False))
        progress(blocks.total(done).solved, self.goal)
        if self._last(done) is None and (self.place / blocks.PROVENANCE).exists():
            self._add_makers([provenance.collect(model.mjcf_hash())])
        new_blocks = self._played(number for number in itertools.count() if number not in done)
        while (last := self._last(done)) is None:
            self._write(*next(new_blocks))
            done |= self._tallies(self.block_files(pieces=False))
            progress(blocks.total(done).solved, self.goal)
        return pd.concat([self._checked(number) for number in range(last + 1)], ignore_index=True)

    def restore(self, kept: pd.DataFrame, count: int) -> None:
        """Writes the first `count` blocks again from the `kept` rows of a database, so that the search can continue.

        Draws that the database does not hold get a score of 0 and no length. Blocks that exist stay as they are. Raises
        FolderMismatch if the rows do not belong to this search.
        """
        self.begin()
        key = ["reach", "gain", "critical"]
        restored = 0
        for number in range(count):
            draws = montecarlo.draw(self.source, self.search, number).assign(score=0.0, length=np.nan)
            next_kept = kept.iloc[restored : restored + len(draws)]
            rows = pd.MultiIndex.from_frame(draws[key]).get_indexer(pd.MultiIndex.from_frame(next_kept[key]))
            rows = rows[np.logical_and.accumulate(rows >= 0)]
            draws.loc[rows, ["score", "length"]] = next_kept[["score", "length"]].head(len(rows)).to_numpy(float)
            restored += len(rows)
            if not self.block_file(number).exists():
                self._write(number, draws)
        if restored < len(kept):
            raise folder_config.FolderMismatch(
                f"row {restored} of the database does not belong to a search with seed {self.search.seed}"
            )

    def _tallies(self, files: dict[int, Path]) -> dict[int, Tally]:
        """The tallies of blocks; each block is read once."""
        tallies = blocks.update_tallies(files, self._read)
        self._read.update(tallies)
        return tallies

    def _last(self, done: dict[int, Tally]) -> int | None:
        """The last block that the goal needs; None if blocks are missing."""
        return block_work.last_needed({number: tally.solved for number, tally in done.items()}, self.goal)

    def _played(self, numbers: Iterable[int]) -> Iterator[tuple[int, pd.DataFrame]]:
        """Plays the blocks with these numbers; yields each number and its draws with outcomes."""
        drawn = ((number, montecarlo.draw(self.source, self.search, number)) for number in numbers)
        return outcomes.play_blocks(self.source, self.engine, drawn, self.search.experts)

    def _write(self, number: int, draws: pd.DataFrame) -> None:
        tables.write(self.block_file(number), draws, compression="zstd")

    def _checked(self, number: int) -> pd.DataFrame:
        """A block that was played; raises DamagedBlock if it does not hold the draws with this number."""
        block = blocks.read(file := self.block_file(number))
        blocks.check(file, block, montecarlo.draw(self.source, self.search, number))
        return block

    def _take_pieces(self) -> None:
        """Puts the blocks of shares among the blocks of the search, and their makers into its provenance.

        Raises DamagedBlock if a block differs from the one that is there, and the errors of `stored`.
        """
        if not (pieces := self.stored()):
            return
        self._add_makers([piece.provenance for piece in pieces.values()])
        for name, piece in pieces.items():
            file, (source, sha256) = self.block_file(int(name)), next(iter(piece.files.items()))
            if not file.exists():
                atomic.write_atomically(file, functools.partial(shutil.copyfile, source))
            elif hashing.sha256(file) != sha256:
                raise blocks.DamagedBlock(file, f"it differs from {source}, which is the same block")
        self.remove(pieces.values())

    def _add_makers(self, makers: list[dict[str, Any]]) -> None:
        """Adds to the provenance of the search. Blocks that were there before count as made by this process."""
        file = self.place / blocks.PROVENANCE
        if file.exists() or self.block_files(pieces=False):
            makers = [*makers, blocks.read_makers(self.place)]
        atomic.write_json(file, provenance.merged(makers))
