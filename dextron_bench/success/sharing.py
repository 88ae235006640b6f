"""A data set that several processes generate: the blocks of one share, and whether any are missing."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path

from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.rows import Rows
from dextron_bench.storage import shares
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.shares import MissingPieces, Share, blocks_needed
from dextron_bench.success import block_pieces, generation
from dextron_bench.success.generation import DatasetConfig


def generate_share(
    source: Source,
    train: Rows,
    config: DatasetConfig,
    folder: Path,
    rows: int,
    agents: Mapping[str, Agent],
    share: Share,
    threads: int = 0,
    progress: Progress = no_progress,
) -> int:
    """Plays the blocks of a share until, as far as the folder shows, all shares together have `rows` transitions.

    Returns the number of this share's blocks; `progress` receives such numbers. A share has whole cycles of blocks, so
    that it sees every kind. Raises the errors of `generate`.
    """
    content = generation.write_or_check_config(folder, config, rows)
    block_pieces.read(folder, content)  # Checks them.
    mine = 0
    for number in itertools.count():
        sizes = block_pieces.block_sizes(folder)
        needed = blocks_needed(list(sizes.values()), rows)
        if number >= needed:
            break
        if not share.has(number // config.cycle):
            continue
        progress(mine, 0 if needed == math.inf else max(mine, math.ceil(needed / share.of)))
        if number not in sizes:
            file = block_pieces.file_of(folder, number)
            generation.play_block(source, train, config, number, agents, threads, file)
            block_pieces.write_stamp(folder, content, number)
        mine += 1
    return mine


def check_complete(folder: Path, config: DatasetConfig, rows: int) -> None:
    """Raises MissingPieces if blocks are missing for `rows` transitions, and the errors of `shares.Work.read`."""
    block_pieces.read(folder, generation.write_or_check_config(folder, config, rows))
    sizes, total = block_pieces.block_sizes(folder), transitions(folder)
    if total < rows:
        names = [f"block {number:06d}" for number in range(max(sizes, default=-1) + 1)]
        shares.check_complete(f"the data set in {folder}", names, {f"block {number:06d}" for number in sizes})
        raise MissingPieces(
            f"the data set in {folder} lacks the blocks from {len(names):06d} on: the blocks before have {total} of "
            f"{rows} transitions; run the shares again, or leave out --merge"
        )


def transitions(folder: Path) -> int:
    """The number of transitions in the blocks and pieces of a data set, up to the first block that is missing."""
    sizes = block_pieces.block_sizes(folder)
    return sum(sizes[number] for number in itertools.takewhile(sizes.__contains__, itertools.count()))
