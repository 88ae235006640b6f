"""Selects episodes to view: all recordings at a place, or rows of the table of episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from dextron_bench.catalogue import expressions
from dextron_bench.catalogue.episodes import COLUMNS, NoEpisodes
from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.runs import recording_files
from dextron_bench.storage.folders import visible
from dextron_bench.storage.run_folder import TRACKING, RunFolder

LIMIT = 5  # Episodes that are selected if the filter names no number.


class BadFilter(ValueError):
    """A filter that contradicts itself."""


@dataclass(frozen=True, slots=True)
class EpisodeFilter:
    """Selects episodes by run, split and outcome; an empty entry, and False, select all. Raises BadFilter.

    `where` is an expression over the columns of the table (`expressions.py`).

    `worst` and `best` are numbers of episodes with the lowest and the highest returns; without either, the first LIMIT
    episodes are selected.
    """

    method: tuple[str, ...] = ()
    reaches: tuple[str, ...] = ()
    split: tuple[str, ...] = ()
    seed: tuple[int, ...] = ()
    row: tuple[int, ...] = ()
    cause: tuple[str, ...] = ()
    failed: bool = False
    worst: int | None = None
    best: int | None = None
    where: str = ""

    def __post_init__(self) -> None:
        for name in ("worst", "best"):
            if (count := getattr(self, name)) is not None and count < 1:
                raise BadFilter(f"--{name} {count}: select 1 episode or more")


def recordings(places: Sequence[Path]) -> list[Path]:
    """The recordings at places, which are recordings or folders; each file once. Raises NoEpisodes."""
    files: dict[Path, None] = {}
    for place in places:
        if not place.exists():
            raise NoEpisodes(f"{place} does not exist; `dextron-bench run --record 3` makes recordings, in runs")
        place_files = [place] if place.is_file() else [file for file in visible(place, "**/*.rrd") if _is_episode(file)]
        if not place_files:
            raise NoEpisodes(f"no recordings at {place}; make some with `dextron-bench run --record 3`")
        files |= dict.fromkeys(place_files)
    return list(files)


def _is_episode(file: Path) -> bool:
    """True for a file that may be the recording of an episode; a tracker's file of a whole training is none."""
    return file.is_file() and not any(part.startswith(TRACKING) for part in file.parts[-3:-1])


def hashes(files: Sequence[Path]) -> dict[Path, str]:
    """The SHA-256 of each recording that the manifest of its run lists; raises DamagedFile."""
    manifests = {
        folder: recording_files.manifest(RunFolder(folder)) for folder in {file.parent.parent for file in files}
    }
    listed = [(file, manifests[file.parent.parent]) for file in files]
    return {file: manifest[file.name] for file, manifest in listed if file.name in manifest}


def select(table: pd.DataFrame, episode_filter: EpisodeFilter) -> tuple[pd.DataFrame, int]:
    """The episodes that a filter selects, and the number that pass it; raises NoEpisodes, BadExpression."""
    passing = matching(table, episode_filter)
    played = passing[passing["steps"] > 0]
    if played.empty:
        unplayed = "; the agent failed before their first step" if len(passing) else ""
        raise NoEpisodes(f"{len(passing)} of {len(table)} episodes match the filter{unplayed}")
    if episode_filter.worst is None and episode_filter.best is None:
        return played.head(LIMIT), len(played)
    return best_and_worst(played, episode_filter), len(played)


def best_and_worst(table: pd.DataFrame, episode_filter: EpisodeFilter) -> pd.DataFrame:
    """The episodes with the lowest and the highest returns, as many as the filter says; all if it names no number."""
    if episode_filter.worst is None and episode_filter.best is None:
        return table
    worst = table.sort_values("return", kind="stable").head(episode_filter.worst or 0)
    best = table.sort_values("return", ascending=False, kind="stable").head(episode_filter.best or 0)
    selected = pd.concat([worst, best])
    return selected[~selected.index.duplicated()]


def matching(table: pd.DataFrame, episode_filter: EpisodeFilter) -> pd.DataFrame:
    """All episodes that pass a filter, without its limit on their number; raises NoEpisodes, BadExpression."""
    table = expressions.filtered(table, episode_filter.where, COLUMNS)
    for name in ("method", "reaches", "split", "seed", "row", "cause"):
        if values := getattr(episode_filter, name):
            _check(table, name, values)
            table = table[table[name].isin(values)]
    return table[~table["success"]] if episode_filter.failed else table


def _check(table: pd.DataFrame, name: str, values: Sequence[str | int]) -> None:
    """Raises NoEpisodes, with the valid values, for a value that no episode has."""
    valid = list(CAUSES) if name == "cause" else sorted(table[name].unique())
    if unknown := [value for value in values if value not in valid]:
        choice = f"{valid[0]} to {valid[-1]}" if name == "row" else ", ".join(map(str, valid))
        raise NoEpisodes(f"no episode has {name} {unknown[0]!r}; choose from {choice}")
