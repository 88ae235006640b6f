"""Episodes played again from a split's settings and a table's actions, and held against what the table says."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.evaluation import episode_table
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.replay import replay
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.loading import Split

TOLERANCE = 1e-3  # How far a number of the last state may be off on another platform.
AGREEING = 0.99  # The share of episodes that must end alike there.
EXACT = ("length", "terminated", "truncated", "success", "score", "cause", "closing_lag", "trace")
WORDS = {
    "length": "number of steps", "score": "return", "cause": "cause of failure", "closing_lag": "closing lag",
    "trace": "hash of states, actions and rewards",
}  # fmt: skip

Report = Callable[[int, int], None]  # Told (episodes done, all).
Look = Callable[[str, int, Episode], None]  # Shown each (split, row, episode) as it was played again.


@dataclass(slots=True)
class Replayed:
    """The rows as they are when played again, and how they differ from the table's."""

    rows: pd.DataFrame
    episodes: int = 0
    exact: int = 0  # Episodes equal bit for bit.
    alike: int = 0  # Episodes with the same success, length and failure, and a last state within TOLERANCE.
    differing: list[str] = field(default_factory=list)  # A line for each episode that is not exact.


def again(
    source: Source,
    wanted: Sequence[Split],
    table: pd.DataFrame,
    threads: int = 0,
    report: Report = lambda done, total: None,
    look: Look = lambda split, row, episode: None,
) -> Replayed:
    """Plays a whole table again; its rows are those of the splits (see `tables.faults`)."""
    made, found = [], Replayed(pd.DataFrame())
    for split, row, told, episode in _played(source, wanted, table, threads):
        look(split.name, row, episode)
        new = episode_table.row(split, row, episode)
        made.append(new)
        found.episodes += 1
        other = [name for name in EXACT if not _equal(new[name], told[name])]
        found.exact += not other
        found.alike += _alike(new, told)
        if other:
            found.differing.append(f"{split.name} row {row}: {_said(other[0], told, new)}")
        report(found.episodes, len(table))
    found.rows = pd.DataFrame(made).sort_values(["split", "row"], ignore_index=True)
    return found


def _played(
    source: Source, wanted: Sequence[Split], table: pd.DataFrame, threads: int
) -> Iterator[tuple[Split, int, dict[str, Any], Episode]]:
    for split in wanted:
        rows = table[table["split"] == split.name].sort_values("row").to_dict("records")
        settings = [split.cases[row["row"]].setting for row in rows]
        for place, episode in replay(source, settings, [np.asarray(row["actions"], float) for row in rows], threads):
            told = {str(name): value for name, value in rows[place].items()}
            if told["failure"] and episode.failure:  # Its agent failed where its actions end.
                episode = replace(episode, failure=told["failure"])
            yield split, told["row"], told, episode


def _equal(new: Any, told: Any) -> bool:
    return bool(new == told or (new != new and told != told))


def _alike(new: dict[str, Any], told: dict[str, Any]) -> bool:
    same = all(_equal(new[name], told[name]) for name in ("success", "length", "failure"))
    return same and bool(np.abs(np.asarray(new["final"]) - np.asarray(told["final"], float)).max() <= TOLERANCE)


def _said(name: str, told: dict[str, Any], new: dict[str, Any]) -> str:
    if name == "trace":
        return f"the {WORDS[name]} is another than that of its actions played again"
    return f"says {WORDS.get(name, name)} {told[name]}; played again it is {new[name]}"
