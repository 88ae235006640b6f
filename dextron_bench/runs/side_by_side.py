"""Two runs on the same row of a split, side by side."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from dextron_bench import recording
from dextron_bench.runs import rerecording, selection
from dextron_bench.runs.selection import EpisodeFilter, NoEpisodes

KEY = ["reaches", "split", "digest", "row"]
PAIRS = "pairs"  # Where pairs are kept, below the folder of all runs.


def contrast(first: Path, second: Path, wish: EpisodeFilter, runs: Path) -> Path:
    """One recording in which two agents play the same setting; the places are recordings, or folders of runs.

    Of runs it takes the first row as wished for whose outcomes differ, or the first of all where none do. Raises
    NoEpisodes, and what `recording.pair` and `restoration.restore` do.
    """
    if first.is_file() and second.is_file():
        return recording.pair(runs / PAIRS / f"{first.stem}--{second.stem}.rrd", first, second)
    rows = [_first(place, wish) for place in (first, second)]
    both = rows[0].merge(rows[1][[*KEY, "success", "method", "seed"]], on=KEY, suffixes=("", "_b"))
    if both.empty:
        raise NoEpisodes(f"{first} and {second} have no row of a split in common that is as asked for")
    apart = both[both["success"] != both["success_b"]]
    chosen = (apart if len(apart) else both).iloc[[0]]
    picked = [table.merge(chosen[KEY], on=KEY).head(1) for table in rows]
    files = [rerecording.restore(each)[0] for each in picked]
    row = chosen.iloc[0]
    name = f"{row['method']}-{row['seed']}--{row['method_b']}-{row['seed_b']}--{row['split']}-{row['row']:04d}.rrd"
    return recording.pair(runs / PAIRS / name, *files)


def _first(place: Path, wish: EpisodeFilter) -> pd.DataFrame:
    """The episodes as wished for of the first run at a place."""
    table = selection.episodes([place])
    found = selection.matching(table[table["folder"] == table["folder"].iloc[0]], wish)
    return found[found["length"] > 0]
