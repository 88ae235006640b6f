"""`dextron-bench runs tag, note, archive, rm, export`: marks runs, puts them away, and writes them for MLflow."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import print_warning

if TYPE_CHECKING:
    from dextron_bench.catalogue.run_catalogue import Entry

ARCHIVE = "archive"  # Beside the folder of all runs, after its name.
RunName = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]


class NotConfirmed(ValueError):
    """Runs that would be removed without a confirmation."""


class LinkedRuns(ValueError):
    """Some of the runs to which one link leads."""


class AlreadyArchived(ValueError):
    """An archive that holds a run of the same name."""


@dataclass(frozen=True)
class Tag:
    """Add tags to a run, or remove them.

    Example: dextron-bench runs tag rlil-0.1/real baseline paper
    """

    run: RunName
    """The run: its label, or its label and source of reaches, as in rlil-0.1/real."""
    tags: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="TAG")]
    """The tags."""
    remove: bool = False
    """Remove these tags instead."""
    runs: Path = Path("runs")
    """Folder of all runs."""

    def __call__(self) -> int:
        from dextron_bench.runs import annotations

        folder = _find(self.runs, self.run).folder
        notes = annotations.read(folder)
        others = tuple(tag for tag in notes.tags if tag not in self.tags)
        annotations.write(folder, replace(notes, tags=others if self.remove else (*others, *self.tags)))
        return DONE


@dataclass(frozen=True)
class Note:
    """Write a note to a run, in the place of its old one.

    Example: dextron-bench runs note rlil-0.1/real "The first run with the new rewards."
    """

    run: RunName
    """The run: its label, or its label and source of reaches, as in rlil-0.1/real."""
    text: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TEXT")]
    """The note; an empty text removes it."""
    runs: Path = Path("runs")
    """Folder of all runs."""

    def __call__(self) -> int:
        from dextron_bench.runs import annotations

        folder = _find(self.runs, self.run).folder
        annotations.write(folder, replace(annotations.read(folder), note=self.text))
        return DONE


@dataclass(frozen=True)
class Archive:
    """Move runs out of the way, into a folder beside the folder of all runs; move them back to use them again.

    Of a run whose folder, or whose method's folder, is a link, the link moves and its files stay where they are.

    Example: dextron-bench runs archive mine-near0.06/synthetic
    """

    run: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The runs, by label, or by label and source of reaches."""
    runs: Path = Path("runs")
    """Folder of all runs."""

    def __call__(self) -> int:
        from dextron_bench.storage import folders

        archive = self.runs.parent / f"{self.runs.name or Path.cwd().name}-{ARCHIVE}"
        places = {folder: archive / folder.relative_to(self.runs) for folder in _folders(self.runs, self.run)}
        for folder, place in places.items():
            if os.path.lexists(place):
                raise AlreadyArchived(f"{place} exists; remove it, or give it another name")
            place.parent.mkdir(parents=True, exist_ok=True)
            folders.move(folder, place)
            _remove_if_empty(folder, self.runs)
            print(place)
        return DONE


@dataclass(frozen=True)
class Remove:
    """Remove runs with all their files, after a question.

    Of a run whose folder, or whose method's folder, is a link, only the link is removed. Its files stay, as do those to
    which links in a run's folder lead; a line names the place.

    Example: dextron-bench runs rm mine-near0.06/synthetic --yes
    """

    run: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The runs, by label, or by label and source of reaches."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    yes: bool = False
    """Remove them without a question."""

    def __call__(self) -> int:
        from dextron_bench.storage import folders

        places = _folders(self.runs, self.run)
        if not self.yes:
            names = ", ".join(self.run)
            if not sys.stdin.isatty():
                raise NotConfirmed(f"{names} would be removed for good; confirm with --yes")
            if input(f"remove {names} for good? [y/N] ").strip().lower() not in ("y", "yes"):
                return DONE
        for folder in places:
            for target in folders.remove(folder):
                print_warning(f"only the link to {target} was removed; its files are still there")
            _remove_if_empty(folder, self.runs)
        return DONE


@dataclass(frozen=True)
class Export:
    """Write runs into a database of MLflow, with settings, scores and learning curves. Needs the extra `mlflow`.

    A run that is not finished is written as it is. A line names each run whose files cannot be read, and the exit code
    is 1; the others are written.

    Example: dextron-bench runs export --into exported
    """

    into: Path
    """The folder to write, new or empty; `cd FOLDER && mlflow ui` shows it."""
    run: Annotated[tuple[str, ...], tyro.conf.arg(metavar="RUN")] = ()
    """The runs; all by default."""
    runs: Path = Path("runs")
    """Folder of all runs."""

    def __call__(self) -> int:
        from dextron_bench.catalogue import exported_runs, mlflow_export, run_catalogue

        entries = run_catalogue.entries(self.runs)
        chosen = [run_catalogue.find(entries, name) for name in self.run] if self.run else entries
        exported, left_out = exported_runs.collect(chosen)
        mlflow_export.write(exported, self.into)
        print(f"{len(exported)} runs in {self.into / mlflow_export.DATABASE}")
        for line in left_out:
            print_warning(line)
        return DIFFERS if left_out else DONE


def _remove_if_empty(folder: Path, runs: Path) -> None:
    """Removes the folder of the label of a folder that was removed, unless it has other runs."""
    if folder.parent != runs:
        with suppress(OSError):
            folder.parent.rmdir()


def _folders(runs: Path, names: Iterable[str]) -> list[Path]:
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


def _find(runs: Path, name: str) -> Entry:
    from dextron_bench.catalogue import run_catalogue

    return run_catalogue.find(run_catalogue.entries(runs), name)
