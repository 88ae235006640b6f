"""The search for G_s: settings and experts drawn at random, and which of them grasp (paper, II.C).

The search runs in blocks of settings. A block's draws depend on its number alone, so the search can be
killed and taken up again, on any number of threads, and finds the same rows.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.experts import blocks, branching, policies
from dextron_bench.reaches import setting
from dextron_bench.storage import folder_config
from dextron_bench.world.engine import Engine

SLOTS = 1024  # Episodes at once, among them those kept free for experts still to close.


class BadSearch(ValueError):
    """A search that cannot be."""


@dataclass(frozen=True)
class Search:
    """Which search: equal searches find equal rows.

    `experts` are tried per setting, of one gain, one in each of as many equal bands of d_c, so that every
    draw by itself is uniform as in the paper; `block` settings are drawn and stored together.
    """

    reaches: str = "real"
    seed: int = 0
    experts: int = 8
    block: int = 128

    def __post_init__(self) -> None:
        if min(self.experts, self.block) < 1 or self.seed < 0:
            raise BadSearch("a search needs at least one expert and one setting per block, and a seed of 0 or more")


def draw(source: setting.Source, search: Search, block: int) -> pd.DataFrame:
    """The draws of one block: fields of `Setting`, `gain`, `critical`; `experts` rows a setting."""
    rng = np.random.default_rng([search.seed, block])
    settings = setting.to_frame([source.sample(rng) for _ in range(search.block)])
    low, high = policies.CRITICAL_DISTANCE
    band = np.arange(search.experts) + rng.uniform(size=(search.block, search.experts))
    draws = settings.loc[settings.index.repeat(search.experts)].reset_index(drop=True)
    draws["gain"] = np.repeat(rng.uniform(*policies.GAIN, search.block), search.experts)
    draws["critical"] = (low + (high - low) * band / search.experts).ravel()
    return draws


def batches(source: setting.Source, draws: pd.DataFrame, experts_each: int) -> Iterator[branching.ExpertBatch]:
    """One batch for each run of `experts_each` rows that share a setting."""
    gains, criticals = draws["gain"].to_numpy(), draws["critical"].to_numpy()
    firsts = range(0, len(draws), experts_each)
    for i, case in zip(firsts, setting.from_frame(draws.iloc[::experts_each]), strict=True):
        yield branching.ExpertBatch(source.path(case), gains[i], criticals[i : i + experts_each])


@dataclass(frozen=True, slots=True)
class Share:
    """The part of a search that one of several processes does: blocks `index`, `index` + `of`, ..."""

    index: int = 0
    of: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.index < self.of:
            raise BadSearch(f"share {self.index}/{self.of} does not exist; shares count from 0")

    @classmethod
    def parse(cls, text: str) -> Share:
        """A share from text like 0/2; raises BadSearch."""
        index, _, of = text.partition("/")
        if not (index.isdecimal() and of.isdecimal()):
            raise BadSearch(f"share {text!r} is not like 0/2, the first of two")
        return cls(int(index), int(of))


def run(
    source: setting.Source,
    search: Search,
    folder: Path,
    rows: int,
    engine: Engine,
    report: Callable[[blocks.Tally], None] = lambda tally: None,
    share: Share | None = None,
) -> pd.DataFrame:
    """Searches on until `rows` rows have all 20 rewards; returns every draw with its outcome, in order.

    Columns: those of `draw`, then `score` (sum of rewards) and `length` [control steps]. Processes with
    different shares may work in one folder. Raises FolderMismatch where it holds another search, and
    DamagedBlock.
    """
    blocks.write_or_check(asdict(search), folder)
    done = blocks.update_tallies(folder, {})
    report(blocks.total(done))
    if blocks.last_block_needed(done, rows) is None:
        for number, draws in _play(source, search, engine, done, share or Share()):
            blocks.write(folder, number, draws)
            done = blocks.update_tallies(folder, done)
            report(blocks.total(done))
            if blocks.last_block_needed(done, rows) is not None:
                break
    last = blocks.last_block_needed(done, rows)
    assert last is not None
    return pd.concat([blocks.read(blocks.block_file(folder, number)) for number in range(last + 1)], ignore_index=True)


def restore(source: setting.Source, search: Search, folder: Path, kept: pd.DataFrame, count: int) -> None:
    """Puts in store the first `count` blocks, of which a database holds the `kept` rows, to search on from there.

    Only what a database knows comes back: draws it did not keep get a score of 0 and no length. Blocks
    already in store stay. Raises FolderMismatch where rows are not of this search.
    """
    blocks.write_or_check(asdict(search), folder)
    key = ["reach", "gain", "critical"]
    found = 0
    for number in range(count):
        draws = draw(source, search, number).assign(score=0.0, length=np.nan)
        ahead = kept.iloc[found : found + len(draws)]
        place = pd.MultiIndex.from_frame(draws[key]).get_indexer(pd.MultiIndex.from_frame(ahead[key]))
        place = place[np.logical_and.accumulate(place >= 0)]
        draws.loc[place, ["score", "length"]] = ahead[["score", "length"]].head(len(place)).to_numpy(float)
        found += len(place)
        if not blocks.block_file(folder, number).exists():
            blocks.write(folder, number, draws)
    if found < len(kept):
        raise folder_config.FolderMismatch(f"row {found} of the database is not of a search with seed {search.seed}")


def _play(
    source: setting.Source, search: Search, engine: Engine, done: Iterable[int], share: Share
) -> Iterator[tuple[int, pd.DataFrame]]:
    """Yields the blocks that are not done, each when it is complete, without end; the engine never idles."""
    skip = frozenset(done)
    under_way: list[_Block] = []

    def asked() -> Iterator[branching.ExpertBatch]:
        for block in (number for number in itertools.count(share.index, share.of) if number not in skip):
            draws = draw(source, search, block)
            under_way.append(_Block(block, draws, np.zeros(len(draws)), np.zeros(len(draws), int), search.block))
            yield from batches(source, draws, search.experts)

    for number, found in branching.play(engine, asked()):
        current = under_way[number // search.block]
        first = number % search.block * search.experts
        rows = slice(first, first + search.experts)
        current.scores[rows], current.lengths[rows] = found.returns, found.lengths
        current.left -= 1
        if not current.left:
            yield current.number, current.draws.assign(score=current.scores, length=current.lengths)
            del current.draws


@dataclass(slots=True)
class _Block:
    """A block under way; `left` settings are still unanswered."""

    number: int
    draws: pd.DataFrame
    scores: np.ndarray
    lengths: np.ndarray
    left: int
