"""Fresh settings: drawn like a split's, from a seed that nobody knew when an agent was made.

A policy that has learned a split by heart scores less on them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.experts import montecarlo, outcomes
from dextron_bench.experts.policies import Case
from dextron_bench.reaches import setting
from dextron_bench.reaches.setting import ReachSource
from dextron_bench.reaches.sources import open_source
from dextron_bench.splits import hard
from dextron_bench.splits.building import Sizes
from dextron_bench.splits.loading import (
    Split,
    cases_from_frame,
    known_splits,
    load_split,
    ranking_splits,
    split_digest,
)
from dextron_bench.splits.near_equal import SETTING
from dextron_bench.splits.scanning import Scanner
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world import task
from dextron_bench.world.engine import Engine

BLOCK = 128  # Settings that are drawn and played together; another number draws other settings.
REACHES = {  # The splits whose reaches a fresh split has: the same distribution as the split itself.
    "test": ("train", "val", "test"),
    "unseen-reach": ("unseen-reach",),
    "unseen-subject": ("unseen-subject",),
}
NEW = 400  # New reaches of a fresh split of `synthetic`, as many as `test` has, about.


def draw(reaches: str, seed: int, engine: Engine, rows: int, progress: Progress = no_progress) -> list[Split]:
    """A fresh split of `rows` cases for each split that ranks methods; equal for equal seeds.

    Reaches of `synthetic` are new ones; `real` has the reaches of the shipped split. Offsets and duration noise are
    new, and a setting is kept if a search with eight experts solves it. Each case has one of the experts that solve
    it, and no window. `hard` is drawn as it was built, near settings of the fresh `test`, but with other durations.
    Raises BadInput, UnknownSplit, MissingData.
    """
    if reaches == "minjerk":
        raise BadInput("settings of minjerk reaches are not drawn by a search")
    source, tables = open_source(reaches), {}
    assert isinstance(source, ReachSource)
    for name in ranking_splits(reaches):

        def drawing(done: int, total: int, note: str = "", name: str = name) -> None:
            progress(done, total, f"drawing fresh settings of {name}")

        names = source.new_reaches(NEW, np.random.default_rng([seed, 0, 6, *name.encode()])) or _shipped(reaches, name)
        if name in REACHES:
            tables[name] = solved(source.on_reaches(names), rows, seed, engine, drawing)
        else:
            tables[name] = _hard(source, tables["test"], rows, seed, engine, drawing)
    return [
        Split(name=name, reaches=reaches, digest=split_digest(table), cases=tuple(cases_from_frame(table)))
        for name, table in tables.items()
    ]


def solved(
    source: setting.Source, count: int, seed: int, engine: Engine, progress: Progress = no_progress
) -> pd.DataFrame:
    """`count` settings of a source that a search solves, each with one of the experts that do."""
    rows = pd.DataFrame()
    blocks = _solved_blocks(source, seed, engine)
    while len(rows) < count:
        rows = pd.concat([rows, next(blocks)], ignore_index=True)
        progress(min(len(rows), count), count)
    return rows.head(count).assign(window=0.0)


def _solved_blocks(source: setting.Source, seed: int, engine: Engine) -> Iterator[pd.DataFrame]:
    """The solved settings of one block of draws after the other, without end: a row for each setting."""
    search = montecarlo.Search(source.name, seed, block=BLOCK)
    drawn = ((number, montecarlo.draw(source, search, number)) for number in itertools.count())
    for number, draws in outcomes.play_blocks(source, engine, drawn, search.experts):
        successful = draws[draws["score"] == task.SUCCESS]
        shuffled = successful.sample(frac=1.0, random_state=np.random.default_rng([seed, number, 4]))
        yield shuffled.drop_duplicates(SETTING).sort_index()


def _shipped(reaches: str, split: str) -> list[str]:
    """The reaches of the shipped splits in REACHES, sorted."""
    return sorted({case.setting.reach for part in REACHES.get(split, ()) for case in _cases(reaches, part)})


def _cases(reaches: str, name: str) -> Sequence[Case]:
    """The cases of a shipped split; none if the source has no such split."""
    return load_split(reaches, name).cases if name in known_splits(reaches) else ()


def _hard(
    source: ReachSource, near: pd.DataFrame, count: int, seed: int, engine: Engine, progress: Progress
) -> pd.DataFrame:
    """Rows of `hard` near fresh settings, with the distance that is best for the rule of thumb on `val`."""
    scanner, sizes = Scanner(source, engine), Sizes()
    distance = hard.best_distance(scanner, setting.to_frame([case.setting for case in _cases(source.name, "val")]))
    settings = hard.HardSettings(
        scanner, near, near.head(0), distance, sizes.coarse, sizes.scan, new_noise=source.sample_noise
    )
    return settings.draw(count, seed, progress).assign(window=0.0)


def to_frame(splits: list[Split]) -> pd.DataFrame:
    """A table of fresh settings, from which `from_frame` makes the splits again."""
    return pd.concat([_frame(split) for split in splits], ignore_index=True)


def from_frame(table: pd.DataFrame, reaches: str) -> list[Split]:
    """The fresh splits in a table with the columns of a setting, `split`, `gain` and `critical`."""
    return [
        Split(name=str(name), reaches=reaches, digest=split_digest(rows), cases=tuple(cases_from_frame(rows)))
        for name, rows in table.assign(window=0.0).groupby("split", sort=False)
    ]


def _frame(split: Split) -> pd.DataFrame:
    experts = pd.DataFrame([(case.expert.gain, case.expert.critical) for case in split.cases])
    frame = setting.to_frame([case.setting for case in split.cases])
    return frame.assign(split=split.name, gain=experts[0], critical=experts[1])
