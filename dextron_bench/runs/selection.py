"""What to look at: the recordings at a place, or episodes picked from the tables of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation import diagnosis
from dextron_bench.runs import recording_files, result_files, run_files
from dextron_bench.storage import atomic

LIMIT = 5  # Episodes that are picked where nobody says how many.


class NoEpisodes(ValueError):
    """A place without recordings, or a wish that no episode fulfils."""


class BadFilter(ValueError):
    """A wish that cannot be."""


@dataclass(frozen=True, slots=True)
class EpisodeFilter:
    """Which episodes of which runs; what is empty stands for any, and so does False. Raises BadFilter.

    `worst` and `best` say how many of the lowest and of the highest returns; without either the first LIMIT are meant.
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

    def __post_init__(self) -> None:
        for name in ("worst", "best"):
            if (count := getattr(self, name)) is not None and count < 1:
                raise BadFilter(f"--{name} {count}: pick 1 episode or more")


def recordings(places: Sequence[Path]) -> list[Path]:
    """The recordings at places, each a recording or a folder; raises NoEpisodes."""
    found: dict[Path, None] = {}
    for place in places:
        if not place.exists():
            raise NoEpisodes(f"there is no {place}; `dextron-bench run --record 3` makes recordings, in runs")
        here = [place] if place.is_file() else sorted(file for file in place.glob("**/*.rrd") if file.is_file())
        if not here:
            raise NoEpisodes(f"no recordings at {place}; make some with `dextron-bench run --record 3`")
        found |= dict.fromkeys(here)
    return list(found)


def hashes(files: Sequence[Path]) -> dict[Path, str]:
    """The SHA-256 of those recordings of which their run's manifest tells one; raises DamagedFile."""
    manifests = {run: recording_files.manifest(run) for run in {file.parent.parent for file in files}}
    told = [(file, manifests[file.parent.parent]) for file in files]
    return {file: manifest[file.name] for file, manifest in told if file.name in manifest}


def episodes(places: Sequence[Path]) -> pd.DataFrame:
    """The episodes of all runs at places: their tables' rows, with `folder`, `method`, `reaches` and `seed` of the run.

    Raises NoEpisodes, DamagedFile.
    """
    tables = [
        run_files.stored(folder, ()).assign(folder=str(folder), **run_identity(folder)) for folder in _runs(places)
    ]
    return pd.concat(tables, ignore_index=True)


def run_identity(folder: Path) -> dict[str, Any]:
    """Method, source of reaches and seed of a run, as its recordings tell them; raises DamagedFile."""
    if (folder / result_files.RESULT).exists():
        told = result_files.read_result(folder / result_files.RESULT)
    else:  # A run under way, whose folder is called after it.
        told = atomic.read_json(folder / run_files.CONFIG) | {"method": folder.resolve().parents[1].name}
    try:
        return {name: told[name] for name in ("method", "reaches", "seed")}
    except KeyError as error:
        raise atomic.DamagedFile(folder / run_files.CONFIG, f"it lacks {error}") from error


def select(table: pd.DataFrame, wish: EpisodeFilter) -> tuple[pd.DataFrame, int]:
    """The episodes that a wish picks, and how many it might have picked; raises NoEpisodes."""
    alike = matching(table, wish)
    seen = alike[alike["length"] > 0]
    if seen.empty:
        unseen = "; the agent failed before their first step" if len(alike) else ""
        raise NoEpisodes(f"of {len(table)} episodes {len(alike)} are as asked for{unseen}")
    if wish.worst is None and wish.best is None:
        return seen.head(LIMIT), len(seen)
    worst = seen.sort_values("score", kind="stable").head(wish.worst or 0)
    best = seen.sort_values("score", ascending=False, kind="stable").head(wish.best or 0)
    picked = pd.concat([worst, best])
    return picked[~picked.index.duplicated()], len(seen)


def matching(table: pd.DataFrame, wish: EpisodeFilter) -> pd.DataFrame:
    """The episodes of the runs, on the splits and with the ends that are wished for; raises NoEpisodes."""
    found = table
    for name in ("method", "reaches", "split", "seed", "row", "cause"):
        if wanted := getattr(wish, name):
            _check(table, name, wanted)
            found = found[found[name].isin(wanted)]
    return found[~found["success"]] if wish.failed else found


def _runs(places: Sequence[Path]) -> list[Path]:
    """The folders of runs at or below places, each once."""
    found: dict[Path, None] = {}
    for place in places:
        if place.is_file():
            raise NoEpisodes(f"{place} is a file: episodes are picked from runs; name a run's folder instead")
        here = [file.parent for file in sorted(place.glob(f"**/{run_files.EPISODES}"))]
        if not here:
            raise NoEpisodes(f"no runs at {place} to pick episodes from; make one with `dextron-bench run`")
        found |= dict.fromkeys(here)
    return list(found)


def _check(table: pd.DataFrame, name: str, wanted: Sequence[str | int]) -> None:
    """Raises NoEpisodes, with what there is, for what no episode has."""
    known = list(diagnosis.CAUSES) if name == "cause" else sorted(table[name].unique())
    if lost := [each for each in wanted if each not in known]:
        there = f"{known[0]} to {known[-1]}" if name == "row" else ", ".join(map(str, known))
        raise NoEpisodes(f"no episode has {name} {lost[0]!r}; there are {there}")
