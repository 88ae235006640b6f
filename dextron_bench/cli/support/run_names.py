"""Runs by their names on the command line."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dextron_bench.catalogue.run_catalogue import Entry


class LinkedRuns(ValueError):
    """Some of the runs to which one link leads."""


def remove_if_empty(folder: Path, runs: Path) -> None:
    """Removes the folder of the label of a folder that was removed, unless it has other runs."""
    if folder.parent != runs:
        with suppress(OSError):
            folder.parent.rmdir()


def folders(runs: Path, names: Iterable[str]) -> list[Path]:
    """The folders of runs, each once; if the folder of a method is a link, that link stands for all its runs.

    Raises LinkedRuns if some of these runs are not named, and UnknownRun.
    """
    from dextron_bench.catalogue import run_catalogue

    known = run_catalogue.entries(runs)
    chosen = {entry.folder for entry in (run_catalogue.find(known, name) for name in names)}
    places = {folder: folder.parent if folder.parent.is_symlink() else folder for folder in chosen}
    for folder in places.values():
        if others := [entry.name for entry in known if entry.folder.parent == folder and entry.folder not in chosen]:
            raise LinkedRuns(f"{folder} is a link, and it has {', '.join(others)} too; name all of its runs, or none")
    return sorted(set(places.values()))


def find(runs: Path, name: str) -> Entry:
    """A run in the folder of all runs; raises UnknownRun."""
    from dextron_bench.catalogue import run_catalogue

    return run_catalogue.find(run_catalogue.entries(runs), name)
