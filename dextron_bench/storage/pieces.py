"""Work that is done in pieces, by several processes on one machine or on many.

A piece is named by what it is, such as the rows of a split or a block of a search. It has files, and a stamp: a JSON
file with its name, everything that it depends on, the code and the machine that made it, and the SHA-256 of its files.
The stamp is written last, so a piece is whole or not there. Pieces lie in the folder `pieces` of the work that they
belong to, until they are put together. Shares (`storage/shares.py`) and a cluster play pieces of any kind of work.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dextron_bench.storage import atomic, folder_config, hashing, provenance, schemas
from dextron_bench.storage.folders import visible
from dextron_bench.storage.progress import Progress, no_progress

FOLDER = "pieces"
CODE = "the benchmark's code"  # In a message.
REMEDY = "use the same command, code and data on all machines, or remove it and run its share again"


class DoubledPiece(ValueError):
    """Two files that are the same piece."""


class ForeignPiece(ValueError):
    """A piece of other work: of another config, code, physics or data."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece on the disk: its stamp, its files with their SHA-256, and the provenance of the process that made it."""

    stamp: Path
    files: Mapping[Path, str]
    provenance: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Place:
    """Where a work is made: the folder of all runs, the folder of the work below it, and the number of threads."""

    runs: Path
    folder: Path
    threads: int


@dataclass(frozen=True, slots=True)
class Recipe:
    """How another process makes a work again: `make(place, **arguments)`.

    `make` is a function of a module, so that every installation has it. It needs imported data of the source `reaches`,
    and `files`, by their path below the folder of all runs.
    """

    make: Callable[..., Work]
    arguments: Mapping[str, Any]
    reaches: str
    files: Mapping[str, Path] = field(default_factory=dict)


class Work(ABC):
    """Work that is done in pieces. Each kind of work says what a piece depends on, how it is played, and where else.

    How pieces become a result is its own too: it takes those that `stored` returns, plays the others, and ends with
    `remove`.
    """

    place: Path  # The folder of the work.

    @property
    def code(self) -> str:
        """The SHA-256 of the code that does the work."""
        return provenance.code_hash()

    def title(self, name: str) -> str:
        """A piece in a message, among the pieces of other work."""
        return name

    @abstractmethod
    def config_of(self, name: str) -> Mapping[str, Any] | None:
        """What the piece of a name depends on besides the code, with the hash of the physics; None if it is of other
        work."""

    @abstractmethod
    def play(self, name: str, report: Progress = no_progress) -> list[Path]:
        """Plays a piece and completes it; returns its files, the stamp last."""

    @abstractmethod
    def recipe(self, name: str) -> Recipe:
        """How another process makes work that has this piece."""

    def file(self, name: str, suffix: str) -> Path:
        """The place for the file of a piece."""
        return self.place / FOLDER / f"{name}{suffix}"

    def complete(self, name: str, files: Sequence[Path]) -> list[Path]:
        """Writes the stamp of a piece whose files below the folder of the work are written; returns all, it last."""
        config = self.config_of(name)
        assert config is not None, name
        stamp = {
            "name": name,
            "depends on": _with_simulator(config),
            "code": self.code,
            "files": {file.relative_to(self.place).as_posix(): hashing.sha256(file) for file in files},
            "provenance": provenance.collect(config["physics"]),
        }
        atomic.write_json(file := self.file(name, ".json"), stamp)
        return [*files, file]

    def stored(self) -> dict[str, Piece]:
        """The pieces of this work that are there, by name.

        Raises ForeignPiece, DoubledPiece, and DamagedFile if a file of a piece is missing or was changed.
        """
        pieces: dict[str, Piece] = {}
        for file in visible(self.place / FOLDER, "*.json"):
            stamp = schemas.read(file, schemas.PIECE)
            config = self.config_of(name := stamp["name"])
            if config is None:
                continue
            if name in pieces:
                raise DoubledPiece(f"{pieces[name].stamp} and {file} are the same piece, {name}; remove one of them")
            stored = {CODE: stamp["code"], **stamp["depends on"]}
            expected = {CODE: self.code, **_with_simulator(config)}
            if differing := list(folder_config.differences(stored, expected)):
                raise ForeignPiece(
                    f"{file} is a piece of other work: it differs in {' and '.join(differing)}; {REMEDY}"
                )
            pieces[name] = Piece(file, self._checked_files(file, stamp["files"]), stamp["provenance"])
        return pieces

    def remove(self, pieces: Iterable[Piece]) -> None:
        """Removes pieces that were put together, the stamps first; files outside the folder of pieces stay."""
        place = self.place / FOLDER
        for piece in pieces:
            for file in (piece.stamp, *(file for file in piece.files if file.parent == place)):
                file.unlink(missing_ok=True)
        if place.exists() and not visible(place, "*"):
            place.rmdir()

    def _checked_files(self, stamp: Path, listed: Mapping[str, str]) -> dict[Path, str]:
        """The files of a piece, whose content is as its stamp says."""
        for name, sha256 in listed.items():
            file = self.place / name
            if not file.exists():
                raise atomic.IncompleteFolder(self.place, f"{file} is missing, and {stamp.name} needs it")
            if hashing.sha256(file) != sha256:
                raise atomic.DamagedFile(stamp, f"{file} is not what the piece was made with")
        return {self.place / name: sha256 for name, sha256 in listed.items()}


class ListedWork(Work):
    """Work whose pieces are known before it begins."""

    @abstractmethod
    def names(self) -> list[str]:
        """The names of all pieces, in order; they do not depend on what is done already."""

    def done(self) -> set[str]:
        """The names of the pieces whose content is in the folder; raises the errors of `stored`."""
        return set(self.stored())


def _with_simulator(config: Mapping[str, Any]) -> dict[str, Any]:
    """A config as JSON has it, with the version of MuJoCo, on which the bits of episodes depend."""
    return json.loads(json.dumps({**config, "mujoco": provenance.version_of("mujoco")}))
