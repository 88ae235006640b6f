"""Two runs on the same row of a split, side by side."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from dextron_bench import recording
from dextron_bench.runs import selection
from dextron_bench.runs.rerecording import rerecord
from dextron_bench.runs.selection import EpisodeFilter, NoEpisodes

KEY = ["reaches", "split", "digest", "row"]
PAIRS = "pairs"  # The folder of such recordings, below the folder of all runs.


def side_by_side(first: Path, second: Path, wanted: EpisodeFilter, runs: Path) -> Path:
    """One recording in which two agents play the same setting; the places are two recordings, or two folders of runs.

    From runs it takes the first row with different outcomes among those that pass the filter; if outcomes never differ,
    the first row. Raises NoEpisodes, and the errors of `recording.write_pair` and `rerecord`.
    """
    if first.is_file() and second.is_file():
        return recording.write_pair(runs / PAIRS / f"{first.stem}--{second.stem}.rrd", first, second)
    tables = [_first_run(place, wanted) for place in (first, second)]
    both = tables[0].merge(tables[1][[*KEY, "success", "method", "seed"]], on=KEY, suffixes=("", "_b"))
    if both.empty:
        raise NoEpisodes(f"{first} and {second} have no row in common that passes the filter")
    differing = both[both["success"] != both["success_b"]]
    chosen = (differing if len(differing) else both).iloc[[0]]
    files = [rerecord(table.merge(chosen[KEY], on=KEY).head(1))[0] for table in tables]
    row = chosen.iloc[0]
    name = f"{row['method']}-{row['seed']}--{row['method_b']}-{row['seed_b']}--{row['split']}-{row['row']:04d}.rrd"
    return recording.write_pair(runs / PAIRS / name, *files)


def _first_run(place: Path, wanted: EpisodeFilter) -> pd.DataFrame:
    """The played episodes of the first run at a place that pass a filter."""
    table = selection.episodes([place])
    passing = selection.matching(table[table["folder"] == table["folder"].iloc[0]], wanted)
    return passing[passing["length"] > 0]
