"""Two runs on the same row of a split, side by side."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from dextron_bench import recording
from dextron_bench.catalogue import episodes, selection
from dextron_bench.catalogue.episodes import NoEpisodes
from dextron_bench.catalogue.rerecording import rerecord
from dextron_bench.catalogue.selection import EpisodeFilter

KEY = ["reaches", "split", "digest", "row"]
PAIRS = "pairs"  # The folder of these recordings, below the folder of all runs.


def side_by_side(first: Path, second: Path, episode_filter: EpisodeFilter, runs: Path) -> Path:
    """One recording in which two agents play the same setting; the places are two recordings, or two folders of runs.

    From runs it takes the first row that passes the filter and has different outcomes; if outcomes never differ, the
    first row that passes. Raises NoEpisodes, and the errors of `recording.write_pair` and `rerecord`.
    """
    if first.is_file() and second.is_file():
        return recording.write_pair(runs / PAIRS / f"{first.stem}--{second.stem}.rrd", first, second)
    tables = [_first_run(place, episode_filter) for place in (first, second)]
    common = tables[0].merge(tables[1][[*KEY, "success", "method", "seed"]], on=KEY, suffixes=("", "_b"))
    if common.empty:
        raise NoEpisodes(f"{first} and {second} have no row in common that passes the filter")
    differing = common[common["success"] != common["success_b"]]
    chosen = (differing if len(differing) else common).iloc[[0]]
    files = [rerecord(table.merge(chosen[KEY], on=KEY).head(1))[0] for table in tables]
    row = chosen.iloc[0]
    name = f"{row['method']}-{row['seed']}--{row['method_b']}-{row['seed_b']}--{row['split']}-{row['row']:04d}.rrd"
    return recording.write_pair(runs / PAIRS / name, *files)


def _first_run(place: Path, episode_filter: EpisodeFilter) -> pd.DataFrame:
    """The played episodes of the first run at a place that pass a filter."""
    table = episodes.read([place])
    passing = selection.matching(table[table["run"] == table["run"].iloc[0]], episode_filter)
    return passing[passing["steps"] > 0]
