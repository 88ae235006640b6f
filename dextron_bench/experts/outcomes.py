"""The outcomes of drawn experts: plays tables of draws, several at once."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dextron_bench.experts import branching
from dextron_bench.reaches import setting
from dextron_bench.world import bottle
from dextron_bench.world.engine import Engine


def play_blocks(
    source: setting.Source, engine: Engine, drawn: Iterable[tuple[int, pd.DataFrame]], experts: int
) -> Iterator[tuple[int, pd.DataFrame]]:
    """Plays numbered blocks of draws; yields each with its outcomes, in their order, while the next are under way.

    Each `experts` consecutive draws share setting and gain. The outcomes are the columns `score` (sum of rewards) and
    `length` [control steps].
    """
    unfinished: deque[_Block] = deque()
    started: dict[int, tuple[_Block, int]] = {}  # By number of the batch: its block, and its first row in it.
    numbers = itertools.count()

    def all_batches() -> Iterator[branching.ExpertBatch]:
        for number, draws in drawn:
            block = _Block(number, draws, np.zeros(len(draws)), np.zeros(len(draws), int), len(draws) // experts)
            unfinished.append(block)
            for k, batch in enumerate(batches(source, draws, experts)):
                started[next(numbers)] = block, k * experts
                yield batch

    for number, played in branching.play(engine, all_batches()):
        block, first = started.pop(number)
        rows = slice(first, first + experts)
        block.scores[rows], block.lengths[rows] = played.returns, played.lengths
        block.left -= 1
        while unfinished and not unfinished[0].left:
            block = unfinished.popleft()
            yield block.number, block.draws.assign(score=block.scores, length=block.lengths)


def batches(source: setting.Source, draws: pd.DataFrame, experts_per_setting: int) -> Iterator[branching.ExpertBatch]:
    """One batch per setting: each `experts_per_setting` consecutive rows share one, and its bottle if they have any."""
    gains, criticals = draws["gain"].to_numpy(), draws["critical"].to_numpy()
    firsts = range(0, len(draws), experts_per_setting)
    once = draws.iloc[::experts_per_setting]
    bottles = bottle.from_frame(once) or [None] * len(once)
    for i, case, one in zip(firsts, setting.from_frame(once), bottles, strict=True):
        yield branching.ExpertBatch(source.path(case), gains[i], criticals[i : i + experts_per_setting], one)


@dataclass(slots=True)
class _Block:
    """A block that is being played; `left` settings have no outcomes yet."""

    number: int
    draws: pd.DataFrame
    scores: np.ndarray
    lengths: np.ndarray
    left: int
