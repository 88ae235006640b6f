"""Plays episodes again from a split's settings and a table's actions, and compares them with the table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
import pandas as pd

from dextron_bench.evaluation import episode_table
from dextron_bench.evaluation.episode_table import Row
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.replay import replay
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.loading import Split
from dextron_bench.storage.progress import Progress, no_progress

TOLERANCE = 1e-3  # Largest difference of a number in the last state on another platform.
AGREEING = 0.99  # Share of episodes that must end alike on another platform.
EXACT = ("length", "terminated", "truncated", "success", "score", "cause", "closing_lag", "trace")
ALIKE = ("success", "score", "length", "failure")  # Equal on another platform, too.
WORDS = {
    "length": "number of steps", "score": "return", "cause": "cause of failure", "closing_lag": "closing lag",
    "trace": "hash of states, actions and rewards",
}  # fmt: skip

Observe = Callable[[str, int, Episode], None]  # Receives (split, row, episode) of each episode that was played again.


@dataclass(slots=True)
class Replayed:
    """The rows computed from the replay, and how they differ from the rows of the table."""

    rows: pd.DataFrame
    episodes: int = 0
    exact: int = 0  # Episodes equal bit for bit.
    alike: int = 0  # Episodes with the same outcome (ALIKE) and a last state within TOLERANCE.
    differing: list[str] = field(default_factory=list)  # A line for each episode that is not exact.


def replay_table(
    source: Source,
    splits: Sequence[Split],
    table: pd.DataFrame,
    threads: int = 0,
    report: Progress = no_progress,
    observe: Observe = lambda split, row, episode: None,
) -> Replayed:
    """Plays all rows of a table again; they must be rows of the splits (see `episode_tables.faults`)."""
    rows, replayed = [], Replayed(pd.DataFrame())
    for split, claimed, episode in _played(source, splits, table, threads):
        row = claimed["row"]
        observe(split.name, row, episode)
        computed = episode_table.row(split, row, episode)
        rows.append(computed)
        replayed.episodes += 1
        differing = [name for name in EXACT if not _equal(computed[name], claimed[name])]
        replayed.exact += not differing
        replayed.alike += _alike(computed, claimed)
        if differing:
            replayed.differing.append(f"{split.name} row {row}: {_difference(differing[0], claimed, computed)}")
        report(replayed.episodes, len(table))
    replayed.rows = pd.DataFrame(rows).sort_values(["split", "row"], ignore_index=True)
    return replayed


def _played(
    source: Source, splits: Sequence[Split], table: pd.DataFrame, threads: int
) -> Iterator[tuple[Split, Row, Episode]]:
    """For each row: its split, the row as the table claims it, and the episode of the replay."""
    for split in splits:
        rows = table[table["split"] == split.name].sort_values("row").to_dict("records")
        actions = [np.asarray(row["actions"], float) for row in rows]
        for place, episode in replay(source, split.rows(row["row"] for row in rows), actions, threads):
            claimed = cast(Row, rows[place])
            if claimed["failure"] and episode.failure:  # The agent failed at the end of its actions.
                episode = replace(episode, failure=claimed["failure"])
            yield split, claimed, episode


def _equal(computed: Any, claimed: Any) -> bool:
    """True if two values are equal; NaN equals NaN."""
    return bool(computed == claimed or (pd.isna(computed) and pd.isna(claimed)))


def _alike(computed: Row, claimed: Row) -> bool:
    """True if two episodes end alike."""
    same = all(_equal(computed[name], claimed[name]) for name in ALIKE)
    distance = np.abs(np.asarray(computed["final"]) - np.asarray(claimed["final"], float)).max()
    return same and bool(distance <= TOLERANCE)


def _difference(name: str, claimed: Row, computed: Row) -> str:
    if name == "trace":
        return f"its {WORDS[name]} differs from the hash of its actions played again"
    return f"says {WORDS.get(name, name)} {claimed[name]}; played again it is {computed[name]}"
