"""The search for G_s: settings and experts drawn at random, and which of them grasp (paper, II.C).

The search runs in blocks of settings. A block's draws depend on its number alone, so the search can be
killed and taken up again, on any number of threads, and finds the same rows.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench import experts, opening, provenance
from dextron_bench.world import model, setting, task
from dextron_bench.world.engine import Engine

KEPT = 1.0  # Rows with a sum of rewards above this are kept (paper, II.C).

SLOTS = 1024  # Episodes at once, among them those kept free for experts still to close.


class BadSearch(ValueError):
    """A search that cannot be."""


class SearchMismatch(ValueError):
    """A folder that holds another search than the one asked for."""


class DamagedBlock(ValueError):
    """A block of a search that cannot be read."""


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


@dataclass(frozen=True, slots=True)
class Tally:
    """How far a search is: blocks in store, draws tried, rows kept, rows with all 20 rewards."""

    blocks: int
    draws: int
    kept: int
    solved: int


def draw(source: setting.Source, search: Search, block: int) -> pd.DataFrame:
    """The draws of one block: fields of `Setting`, `gain`, `critical`; `experts` rows a setting."""
    rng = np.random.default_rng([search.seed, block])
    settings = setting.to_frame([source.sample(rng) for _ in range(search.block)])
    low, high = experts.CRITICAL_DISTANCE
    band = np.arange(search.experts) + rng.uniform(size=(search.block, search.experts))
    draws = settings.loc[settings.index.repeat(search.experts)].reset_index(drop=True)
    draws["gain"] = np.repeat(rng.uniform(*experts.GAIN, search.block), search.experts)
    draws["critical"] = (low + (high - low) * band / search.experts).ravel()
    return draws


def questions(source: setting.Source, draws: pd.DataFrame, experts_each: int) -> Iterator[opening.Question]:
    """One question for each run of `experts_each` rows that share a setting."""
    gains, criticals = draws["gain"].to_numpy(), draws["critical"].to_numpy()
    firsts = range(0, len(draws), experts_each)
    for i, case in zip(firsts, setting.from_frame(draws.iloc[::experts_each]), strict=True):
        yield opening.Question(source.path(case), gains[i], criticals[i : i + experts_each])


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
    report: Callable[[Tally], None] = lambda tally: None,
    share: Share | None = None,
) -> pd.DataFrame:
    """Searches on until `rows` rows have all 20 rewards; returns every draw with its outcome, in order.

    Columns: those of `draw`, then `score` (sum of rewards) and `length` [control steps]. Processes with
    different shares may work in one folder. Raises SearchMismatch where it holds another search, and
    DamagedBlock.
    """
    _claim(search, folder)
    done = _refresh(folder, {})
    report(total(done))
    if last_needed(done, rows) is None:
        for number, draws in _play(source, search, engine, done, share or Share()):
            provenance.write_whole(_file(folder, number), lambda part, d=draws: d.to_parquet(part, compression="zstd"))
            done = _refresh(folder, done)
            report(total(done))
            if last_needed(done, rows) is not None:
                break
    last = last_needed(done, rows)
    assert last is not None
    return pd.concat([_read(_file(folder, number)) for number in range(last + 1)], ignore_index=True)


def total(done: dict[int, Tally]) -> Tally:
    """The sum over blocks."""
    parts = done.values()
    return Tally(len(done), sum(t.draws for t in parts), sum(t.kept for t in parts), sum(t.solved for t in parts))


def last_needed(done: dict[int, Tally], rows: int) -> int | None:
    """The block with which blocks 0, 1, ... reach so many solved rows; None while they do not."""
    solved = number = 0
    while number in done:
        solved += done[number].solved
        if solved >= rows:
            return number
        number += 1
    return None


def _play(
    source: setting.Source, search: Search, engine: Engine, done: Iterable[int], share: Share
) -> Iterator[tuple[int, pd.DataFrame]]:
    """Yields the blocks that are not done, each when it is complete, without end; the engine never idles."""
    skip = frozenset(done)
    under_way: list[_Block] = []

    def asked() -> Iterator[opening.Question]:
        for block in (number for number in itertools.count(share.index, share.of) if number not in skip):
            draws = draw(source, search, block)
            under_way.append(_Block(block, draws, np.zeros(len(draws)), np.zeros(len(draws), int), search.block))
            yield from questions(source, draws, search.experts)

    for number, found in opening.answer(engine, asked()):
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


def _tally(draws: pd.DataFrame) -> Tally:
    score = draws["score"]
    return Tally(1, len(score), int((score > KEPT).sum()), int((score == task.SUCCESS).sum()))


def _claim(search: Search, folder: Path) -> None:
    """Makes the folder this search's, or checks that it is."""
    wanted = {"search": asdict(search), "physics": model.mjcf_hash()}
    file = folder / "search.json"
    if not file.exists():
        provenance.write_json(file, wanted)
    found = json.loads(file.read_text(encoding="utf-8"))
    if found != wanted:
        raise SearchMismatch(f"{folder} holds another search ({found}); choose another folder, or remove it")


def _file(folder: Path, number: int) -> Path:
    return folder / "blocks" / f"{number:06d}.parquet"


def _refresh(folder: Path, done: dict[int, Tally]) -> dict[int, Tally]:
    """The tallies of all blocks in store; only those not yet in `done` are read."""
    stored = sorted(int(file.stem) for file in (folder / "blocks").glob("[0-9]*.parquet"))
    return {number: done.get(number) or _tally(_read(_file(folder, number))) for number in stored}


def _read(file: Path) -> pd.DataFrame:
    try:
        return pd.read_parquet(file)
    except (OSError, ValueError) as error:
        raise DamagedBlock(f"{file} is damaged ({error}); remove it and search again") from error
