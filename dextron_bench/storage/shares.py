"""Work in pieces that several processes do, on one machine or on many: shares, pieces, and what a merge checks.

A piece is named by what it is, such as the rows of a split or a block of a search. It has files, and a stamp: a JSON
file with its name, everything that it depends on, the code and the machine that made it, and the SHA-256 of its files.
The stamp is written last, so a piece is whole or not there. Pieces lie in the folder `pieces` of the work that they
belong to, until a merge has put them together.
"""

from __future__ import annotations

import itertools
import json
import math
import statistics
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msgspec import field

from dextron_bench.storage import atomic, folder_config, hashing, provenance, records
from dextron_bench.storage.folders import visible
from dextron_bench.storage.provenance import Provenance
from dextron_bench.storage.records import Record

FOLDER = "pieces"
CODE = "the benchmark's code"  # In a message.
LISTED = 4  # Names in a message.
REMEDY = "use the same command, code and data on all machines, or remove it and run its share again"


class BadShare(ValueError):
    """A share that does not exist, or flags that contradict each other."""


class MissingPieces(LookupError):
    """A merge that lacks pieces; the message names them."""


class DoubledPiece(ValueError):
    """Two files that are the same piece."""


class ForeignPiece(ValueError):
    """A piece of other work: of another config, code, physics or data."""


@dataclass(frozen=True, slots=True)
class Share:
    """The pieces that one of `of` processes does: those at the places `index`, `index` + `of`, `index` + 2 `of`, ..."""

    index: int = 0
    of: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.index < self.of:
            raise BadShare(f"share {self.index}/{self.of} does not exist; shares count from 0")

    @classmethod
    def parse(cls, text: str) -> Share:
        """The share that a text like 0/2 names; raises BadShare."""
        index, _, of = text.partition("/")
        if not (index.isdecimal() and of.isdecimal()):
            raise BadShare(f"share {text!r} is not like 0/2, the first of two")
        return cls(int(index), int(of))

    def has(self, place: int) -> bool:
        """True if the piece at a place, counted from 0, belongs to this share."""
        return place % self.of == self.index

    def __str__(self) -> str:
        return f"{self.index}/{self.of}"


class Stamp(Record, frozen=True):
    """What the stamp of a piece says: what the piece depends on, and its files with their SHA-256."""

    name: str
    depends_on: dict[str, Any] = field(name="depends on")
    code: str
    files: dict[str, str]
    provenance: Provenance


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece on the disk: its stamp, its files with their SHA-256, and the provenance of the process that made it."""

    stamp: Path
    files: Mapping[Path, str]
    provenance: Provenance


@dataclass(frozen=True, slots=True)
class Work:
    """Work that is done in pieces, in a folder. `code` is the SHA-256 of the code that does it."""

    folder: Path
    code: str

    @property
    def is_begun(self) -> bool:
        """True if there is a folder of pieces."""
        return (self.folder / FOLDER).exists()

    def file(self, name: str, suffix: str) -> Path:
        """The place for the file of a piece."""
        return self.folder / FOLDER / f"{name}{suffix}"

    def write(self, name: str, config: Mapping[str, Any], files: Iterable[Path]) -> Path:
        """Writes the stamp of a piece whose files are complete, and returns it. They lie below the folder of the work.

        `config` is everything that the piece depends on besides the code; it contains the hash of the physics.
        """
        hashes = {file.relative_to(self.folder).as_posix(): hashing.sha256(file) for file in files}
        made_by = provenance.collect(config["physics"])
        stamp = Stamp(name, _with_simulator(config), self.code, hashes, made_by)
        atomic.write_json(file := self.file(name, ".json"), stamp)
        return file

    def read(self, config_of: Callable[[str], Mapping[str, Any] | None]) -> dict[str, Piece]:
        """The pieces that are there, by name. `config_of` returns what a piece depends on, or None to leave it out.

        Raises ForeignPiece, DoubledPiece, and DamagedFile if a file of a piece is missing or was changed.
        """
        pieces: dict[str, Piece] = {}
        for file in visible(self.folder / FOLDER, "*.json"):
            stamp = records.read(file, Stamp)
            config = config_of(name := stamp.name)
            if config is None:
                continue
            if name in pieces:
                raise DoubledPiece(f"{pieces[name].stamp} and {file} are the same piece, {name}; remove one of them")
            stored = {CODE: stamp.code, **stamp.depends_on}
            expected = {CODE: self.code, **_with_simulator(config)}
            if differing := list(folder_config.differences(stored, expected)):
                raise ForeignPiece(
                    f"{file} is a piece of other work: it differs in {' and '.join(differing)}; {REMEDY}"
                )
            pieces[name] = Piece(file, self._checked_files(file, stamp.files), stamp.provenance)
        return pieces

    def remove(self, pieces: Iterable[Piece]) -> None:
        """Removes pieces that were merged, the stamps first; files outside the folder of pieces stay."""
        for piece in pieces:
            piece.stamp.unlink(missing_ok=True)
            for file in piece.files:
                if file.parent == self.folder / FOLDER:
                    file.unlink(missing_ok=True)
        place = self.folder / FOLDER
        if place.exists() and not visible(place, "*"):
            place.rmdir()

    def _checked_files(self, stamp: Path, listed: Mapping[str, str]) -> dict[Path, str]:
        """The files of a piece, whose content is as its stamp says."""
        for name, sha256 in listed.items():
            file = self.folder / name
            if not file.exists():
                raise atomic.IncompleteFolder(self.folder, f"{file} is missing, and {stamp.name} needs it")
            if hashing.sha256(file) != sha256:
                raise atomic.DamagedFile(stamp, f"{file} is not what the piece was made with")
        return {self.folder / name: sha256 for name, sha256 in listed.items()}


def _with_simulator(config: Mapping[str, Any]) -> dict[str, Any]:
    """A config as JSON has it, with the version of MuJoCo, on which the bits of episodes depend."""
    return json.loads(atomic.json_text({**config, "mujoco": provenance.version_of("mujoco")}))


def check_complete(what: str, names: Sequence[str], present: Collection[str]) -> None:
    """Raises MissingPieces if one of the names of pieces is not present."""
    if missing := [name for name in names if name not in present]:
        listed = ", ".join(itertools.islice(missing, LISTED)) + (", ..." if len(missing) > LISTED else "")
        raise MissingPieces(
            f"{what} lacks {len(missing)} of {len(names)} pieces: {listed}; run the shares that have them and put all "
            "folders together, or leave out --merge to do them here"
        )


def blocks_needed(amounts: Sequence[float], goal: float) -> float:
    """About how many blocks hold `goal` together, from the amounts in some of them; infinite if these are all 0.

    It is more than the mean suggests by two standard errors, so that shares that do not see each other rarely do too
    little.
    """
    total = sum(amounts)
    if total <= 0:
        return math.inf
    error = statistics.pstdev(amounts) / math.sqrt(len(amounts))
    return math.ceil(goal * len(amounts) / total * (1.0 + 2.0 * error * len(amounts) / total))
