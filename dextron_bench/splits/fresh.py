"""Fresh settings: drawn like a split's, from a seed that nobody knew when an agent was made.

A policy that has learned a split by heart scores less on them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.experts import montecarlo, outcomes
from dextron_bench.experts.policies import Case
from dextron_bench.reaches import setting
from dextron_bench.reaches.sources import open_source
from dextron_bench.splits import hard
from dextron_bench.splits.building import Sizes
from dextron_bench.splits.loading import Split, cases_from_frame, known_splits, load_split, split_digest
from dextron_bench.splits.near_equal import SETTING
from dextron_bench.splits.scanning import Scanner
from dextron_bench.storage import hashing
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world import task
from dextron_bench.world.engine import Engine

BLOCK = 128  # Settings that are drawn and played together; another number draws other settings.
REACHES = {  # The splits whose reaches a fresh split has: the same distribution as the split itself.
    "test": ("train", "val", "test"),
    "unseen-reach": ("unseen-reach",),
    "unseen-subject": ("unseen-subject",),
}


def seed_of(submission: str, beacon: str) -> int:
    """The seed of fresh settings, from a submission's hash and a value that was not known when it was made."""
    return int(hashing.digest(f"{submission}\n{beacon}".encode())[:16], 16)


def draw(reaches: str, name: str, seed: int, engine: Engine, rows: int = 0, progress: Progress = no_progress) -> Split:
    """A split of `rows` fresh cases (0: as many as the shipped split `name` has); equal for equal seeds.

    Offsets and duration noise are drawn anew, and a setting is kept if a search with eight experts solves it. Each case
    has one of the experts that solve it, and no window. `hard` is drawn as it was built. Raises BadInput,
    UnknownSplit, MissingData.
    """
    if reaches == "minjerk" or name not in (*REACHES, "hard"):
        raise BadInput(f"{name} of {reaches} reaches is not drawn by a search; choose from {list(REACHES)}")
    source, count = open_source(reaches), rows or len(load_split(reaches, name))
    if name == "hard":
        table = _hard(source, reaches, count, seed, engine, progress)
    else:
        names = {case.setting.reach for part in REACHES[name] for case in _cases(reaches, part)}
        table = solved(source, frozenset(names), count, seed, engine, progress)
    return Split(name=name, reaches=reaches, digest=split_digest(table), cases=tuple(cases_from_frame(table)))


def solved(
    source: setting.Source,
    reaches: frozenset[str],
    count: int,
    seed: int,
    engine: Engine,
    progress: Progress = no_progress,
) -> pd.DataFrame:
    """`count` settings on some reaches of a source that a search solves, each with one of the experts that do."""
    rows = pd.DataFrame()
    blocks = _solved_blocks(source, reaches, seed, engine)
    while len(rows) < count:
        rows = pd.concat([rows, next(blocks)], ignore_index=True)
        progress(min(len(rows), count), count)
    return rows.head(count).assign(window=0.0)


def _solved_blocks(
    source: setting.Source, reaches: frozenset[str], seed: int, engine: Engine
) -> Iterator[pd.DataFrame]:
    """The solved settings of one block of draws after the other, without end: a row for each setting."""
    search = montecarlo.Search(source.name, seed, block=BLOCK)
    part = _OfReaches(source, reaches)
    drawn = ((number, montecarlo.draw(part, search, number)) for number in itertools.count())
    for number, draws in outcomes.play_blocks(source, engine, drawn, search.experts):
        successful = draws[draws["score"] == task.SUCCESS]
        shuffled = successful.sample(frac=1.0, random_state=np.random.default_rng([seed, number, 4]))
        yield shuffled.drop_duplicates(SETTING).sort_index()


@dataclass(frozen=True, slots=True)
class _OfReaches:
    """A source's distribution of settings, on some of its reaches only."""

    source: setting.Source
    reaches: frozenset[str]

    def sample(self, rng: np.random.Generator) -> setting.Setting:
        """Draws settings until one is on these reaches."""
        return next(one for one in map(self.source.sample, itertools.repeat(rng)) if one.reach in self.reaches)


def _cases(reaches: str, name: str) -> Sequence[Case]:
    """The cases of a shipped split; none if the source has no such split."""
    return load_split(reaches, name).cases if name in known_splits(reaches) else ()


def _hard(
    source: setting.Source, reaches: str, count: int, seed: int, engine: Engine, progress: Progress
) -> pd.DataFrame:
    """Fresh rows of `hard`, with the distance that is best for the rule of thumb on `val`."""
    scanner, sizes = Scanner(source, engine), Sizes()
    train, val = (_frame(_cases(reaches, name)) for name in ("train", "val"))
    distance = hard.best_distance(scanner, val)
    settings = hard.HardSettings(scanner, train, train.head(0), distance, sizes.coarse, sizes.scan)
    rows = settings.draw(count, seed, progress)
    return rows.assign(window=0.0)


def _frame(cases: Sequence[Case]) -> pd.DataFrame:
    return setting.to_frame([case.setting for case in cases]).assign(gain=[case.expert.gain for case in cases])
