"""Fresh settings: drawn like a split's, from a seed that nobody knew when an agent was made.

A policy that has learned a split by heart scores less on them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pandas as pd

from dextron_bench.experts import montecarlo
from dextron_bench.reaches import setting
from dextron_bench.splits.loading import Split, cases_from_frame, split_digest
from dextron_bench.splits.near_equal import SETTING
from dextron_bench.storage import hashing
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world import task
from dextron_bench.world.engine import Engine

BLOCK = 128  # Settings that are drawn and played together; another number draws other settings.
DRAWN = ("test", "unseen-reach", "unseen-subject")  # Splits whose rows are solved draws of a search, and nothing else.


class NoFreshSettings(ValueError):
    """A split that cannot be drawn again."""


def seed_of(submission: str, beacon: str) -> int:
    """The seed of fresh settings, from a submission's hash and a value that was not known when it was made."""
    return int(hashing.digest(f"{submission}\n{beacon}".encode())[:16], 16)


def draw(
    source: setting.Source, split: Split, seed: int, engine: Engine, rows: int = 0, progress: Progress = no_progress
) -> Split:
    """A split of `rows` fresh cases (0: as many as `split` has) on the reaches of `split`; equal for equal seeds.

    Offsets and duration noise are drawn anew, and a setting is kept if a search with eight experts solves it. Each case
    has one of the experts that solve it, and no window. Raises NoFreshSettings.
    """
    if split.name not in DRAWN or source.name == "minjerk":
        raise NoFreshSettings(f"{split.name} of {source.name} reaches is not drawn by a search; choose from {DRAWN}")
    count, solved = rows or len(split.cases), pd.DataFrame()
    reaches = frozenset(case.setting.reach for case in split.cases)
    for block in _solved_blocks(source, reaches, seed, engine):
        solved = pd.concat([solved, block], ignore_index=True)
        progress(min(len(solved), count), count)
        if len(solved) >= count:
            break
    fresh = solved.head(count).assign(window=0.0)
    return Split(split.name, split.reaches, tuple(cases_from_frame(fresh)), split_digest(fresh))


def _solved_blocks(
    source: setting.Source, reaches: frozenset[str], seed: int, engine: Engine
) -> Iterator[pd.DataFrame]:
    """The solved settings of one block of draws after the other, without end: a row for each setting."""
    search = montecarlo.Search(source.name, seed, block=BLOCK)
    drawn = ((k, montecarlo.draw(montecarlo.OfReaches(source, reaches), search, k)) for k in itertools.count())
    for number, draws in montecarlo.play_blocks(source, engine, drawn, search.experts):
        solved = draws[draws["score"] == task.SUCCESS]
        shuffled = solved.sample(frac=1.0, random_state=np.random.default_rng([seed, number, 4]))
        yield shuffled.drop_duplicates(SETTING).sort_index()
