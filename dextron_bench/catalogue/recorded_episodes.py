"""Recordings as a table of episodes, with causes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import pandas as pd

from dextron_bench.catalogue.selection import EpisodeFilter, best_and_worst, matching
from dextron_bench.recording import Summary
from dextron_bench.runs import run_files
from dextron_bench.storage.run_folder import RunFolder

PROPERTIES = ("method", "reaches", "seed", "split", "row")


def select(summaries: Sequence[Summary], episode_filter: EpisodeFilter) -> list[Summary]:
    """The undamaged recordings that a filter selects, in order; `worst` and `best` sort them. Raises NoEpisodes."""
    table = matching(_table(summaries), episode_filter)
    return [summaries[position] for position in best_and_worst(table, episode_filter).index]


def cause(summary: Summary) -> str | None:
    """Why the episode ended as it did; raises DamagedFile.

    Recordings of version 0.1 do not say it: for them it is known in the folder of their run only.
    """
    if isinstance(stated := summary.properties.get("cause"), str):
        return stated
    run, place = RunFolder(summary.file.parent.parent), (summary.properties.get("split"), summary.properties.get("row"))
    return _causes(run, run.episodes.stat().st_mtime_ns).get(place) if run.episodes.exists() else None


def _table(summaries: Sequence[Summary]) -> pd.DataFrame:
    """A row for each undamaged recording of one episode; its index is the place of the summary."""
    rows = {
        position: {name: summary.properties[name] for name in PROPERTIES}
        | {"score": summary.properties["episode_return"], "success": summary.properties["outcome"] == "success"}
        | {"cause": cause(summary)}
        for position, summary in enumerate(summaries)
        if not summary.damage and all(name in summary.properties for name in PROPERTIES)
    }
    columns = [*PROPERTIES, "score", "success", "cause"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)


@cache
def _causes(run: RunFolder, written: int) -> dict[tuple[object, object], str]:
    """The cause of each episode of a run, by split and row, from the table that was `written` at this time [ns]."""
    table = run_files.stored_episodes(run, ())
    return dict(zip(zip(table["split"], table["row"], strict=True), table["cause"], strict=True))
