"""The search for G_s: draws settings and experts at random, and plays them (paper, II.C).

The search runs in blocks of settings. The draws of a block depend only on its number. So a search that was killed can
continue, on any number of threads, and finds the same rows.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import pandas as pd

from dextron_bench.experts import blocks, outcomes, policies
from dextron_bench.reaches import setting
from dextron_bench.storage import folder_config, provenance, shares
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.shares import MissingPieces, Share, blocks_needed
from dextron_bench.world import model
from dextron_bench.world.engine import Engine

SLOTS = 1024  # Episodes at once, with the slots that are reserved for forks.


class BadSearch(ValueError):
    """Settings of a search that are not possible."""


@dataclass(frozen=True)
class Search:
    """The settings of a search; equal searches find equal rows.

    Each setting is tried with `experts` experts of one gain. The range of d_c is cut into as many equal bands, and each
    expert's d_c is drawn from one band, so that every single draw is uniform as in the paper. `block` settings are
    drawn and stored together.
    """

    reaches: str = "real"
    seed: int = 0
    experts: int = 8
    block: int = 128

    def __post_init__(self) -> None:
        if min(self.experts, self.block) < 1 or self.seed < 0:
            raise BadSearch("a search needs at least one expert and one setting per block, and a seed of 0 or more")


class Sampler(Protocol):
    """What draws settings: a source, or a part of one."""

    def sample(self, rng: np.random.Generator) -> setting.Setting: ...


def draw(source: Sampler, search: Search, block: int) -> pd.DataFrame:
    """The draws of one block, `experts` rows per setting; columns: the fields of `Setting`, `gain`, `critical`."""
    rng = np.random.default_rng([search.seed, block])
    settings = setting.to_frame([source.sample(rng) for _ in range(search.block)])
    low, high = policies.CRITICAL_DISTANCE
    band = np.arange(search.experts) + rng.uniform(size=(search.block, search.experts))
    draws = settings.loc[settings.index.repeat(search.experts)].reset_index(drop=True)
    draws["gain"] = np.repeat(rng.uniform(*policies.GAIN, search.block), search.experts)
    draws["critical"] = (low + (high - low) * band / search.experts).ravel()
    return draws


def run(
    source: setting.Source,
    search: Search,
    folder: Path,
    rows: int,
    engine: Engine,
    progress: Progress = no_progress,
) -> pd.DataFrame:
    """Searches, or continues, until `rows` rows have all 20 rewards; returns every draw with its outcome, in order.

    Columns: the columns of `draw`, then `score` (sum of rewards) and `length` [control steps]. Blocks of shares are
    checked, and become blocks of the search. Calls `progress` with the number of rows with all rewards, and `rows`.
    Raises FolderMismatch if the folder holds another search, DamagedBlock, and the errors of `shares.Work.read`.
    """
    blocks.write_or_check(asdict(search), folder)
    blocks.take_pieces(asdict(search), folder)
    done = blocks.update_tallies(folder, {})
    progress(blocks.total(done).solved, rows)
    if blocks.last_block_needed(done, rows) is None and (folder / blocks.PROVENANCE).exists():
        blocks.add_makers(folder, [provenance.collect(model.mjcf_hash())])
    new_blocks = _played(source, search, engine, itertools.count(), frozenset(done))
    while (last := blocks.last_block_needed(done, rows)) is None:
        blocks.write(folder, *next(new_blocks))
        done = blocks.update_tallies(folder, done)
        progress(blocks.total(done).solved, rows)
    return pd.concat([_stored(source, search, folder, number) for number in range(last + 1)], ignore_index=True)


def run_share(
    source: setting.Source,
    search: Search,
    folder: Path,
    rows: int,
    engine: Engine,
    share: Share,
    progress: Progress = no_progress,
) -> int:
    """Searches the blocks of a share until, as far as the folder shows, all shares together have `rows` solved rows.

    Returns the number of this share's blocks. A share that sees only its own blocks stops at about its part of `rows`
    (see `shares.blocks_needed`). Calls `progress` with numbers of this share's blocks. Raises the errors of `run`.
    """
    blocks.write_or_check(asdict(search), folder)
    blocks.read_pieces(asdict(search), folder)  # Checks them.
    done = blocks.update_tallies(folder, {}, pieces=True)
    new_blocks = _played(source, search, engine, itertools.count(share.index, share.of), frozenset(done))
    while not _is_enough(done, rows, share, progress):
        blocks.write_piece(asdict(search), folder, *next(new_blocks))
        done = blocks.update_tallies(folder, done, pieces=True)
    return sum(share.has(number) for number in done)


def play_piece(source: setting.Source, search: Search, folder: Path, number: int, engine: Engine) -> list[Path]:
    """Plays one block of a search as a piece in a folder; returns its file and its stamp."""
    return blocks.write_piece(asdict(search), folder, *next(_played(source, search, engine, [number], ())))


def check_complete(search: Search, folder: Path, rows: int) -> None:
    """Raises MissingPieces if blocks are missing for `rows` solved rows, and the errors of `shares.Work.read`."""
    blocks.read_pieces(asdict(search), folder)
    done = blocks.update_tallies(folder, {}, pieces=True)
    if blocks.last_block_needed(done, rows) is None:
        count = max(done, default=-1) + 1
        names = [f"block {number:06d}" for number in range(count)]
        shares.check_complete(f"the search in {folder}", names, {f"block {number:06d}" for number in done})
        raise MissingPieces(
            f"the search in {folder} lacks the blocks from {count:06d} on: the blocks before have "
            f"{blocks.total(done).solved} of {rows} rows; run the shares again, or leave out --merge"
        )


def _is_enough(done: dict[int, blocks.Tally], rows: int, share: Share, progress: Progress) -> bool:
    """True if a share has nothing left to search; reports its progress."""
    needed = blocks_needed([tally.solved for tally in done.values()], rows)
    following = next(number for number in itertools.count(share.index, share.of) if number not in done)
    mine = sum(share.has(number) for number in done)
    progress(mine, 0 if needed == math.inf else max(mine, math.ceil((needed - share.index) / share.of)))
    return blocks.last_block_needed(done, rows) is not None or following >= needed


def _played(
    source: setting.Source, search: Search, engine: Engine, numbers: Iterable[int], stored: Collection[int]
) -> Iterator[tuple[int, pd.DataFrame]]:
    """Plays the blocks with these numbers that are not stored; yields each number and its draws with outcomes."""
    drawn = ((number, draw(source, search, number)) for number in numbers if number not in stored)
    return outcomes.play_blocks(source, engine, drawn, search.experts)


def _stored(source: setting.Source, search: Search, folder: Path, number: int) -> pd.DataFrame:
    """A block that was played; raises DamagedBlock if it does not hold the draws with this number."""
    file = blocks.block_file(folder, number)
    block = blocks.read(file)
    blocks.check(file, block, draw(source, search, number))
    return block


def restore(source: setting.Source, search: Search, folder: Path, kept: pd.DataFrame, count: int) -> None:
    """Writes the first `count` blocks of a search again from the `kept` rows of its database, so that it can continue.

    Draws that the database does not hold get a score of 0 and no length. Blocks that exist stay as they are. Raises
    FolderMismatch if the rows do not belong to this search.
    """
    blocks.write_or_check(asdict(search), folder)
    key = ["reach", "gain", "critical"]
    restored = 0
    for number in range(count):
        draws = draw(source, search, number).assign(score=0.0, length=np.nan)
        next_kept = kept.iloc[restored : restored + len(draws)]
        rows = pd.MultiIndex.from_frame(draws[key]).get_indexer(pd.MultiIndex.from_frame(next_kept[key]))
        rows = rows[np.logical_and.accumulate(rows >= 0)]
        draws.loc[rows, ["score", "length"]] = next_kept[["score", "length"]].head(len(rows)).to_numpy(float)
        restored += len(rows)
        if not blocks.block_file(folder, number).exists():
            blocks.write(folder, number, draws)
    if restored < len(kept):
        raise folder_config.FolderMismatch(
            f"row {restored} of the database does not belong to a search with seed {search.seed}"
        )
