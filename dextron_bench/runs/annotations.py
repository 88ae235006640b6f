"""What a person says of a run, its tags and its note, and what went wrong in it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from dextron_bench.errors import BadInput
from dextron_bench.storage import atomic, records, run_times
from dextron_bench.storage.run_folder import RunFolder

NOTES = "notes.json"  # In the folder of a method's runs on one source of reaches.
TAG = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*")
LONGEST = 2000  # Characters of a note.


@dataclass(frozen=True, slots=True)
class Notes:
    """The tags and the note of a run. Raises BadInput."""

    tags: tuple[str, ...] = ()
    note: str = ""

    def __post_init__(self) -> None:
        for tag in self.tags:
            if not TAG.fullmatch(tag):
                raise BadInput(f"tag {tag!r}: use letters, digits and . _ + -")
        if len(self.note) > LONGEST:
            raise BadInput(f"a note has at most {LONGEST} characters, not {len(self.note)}")


class Failure(records.Record, frozen=True):
    """Why an attempt of a run failed."""

    error: str


def read(folder: Path) -> Notes:
    """The notes in a folder, empty if there are none; raises DamagedFile."""
    file = folder / NOTES
    return records.read(file, Notes) if file.exists() else Notes()


def write(folder: Path, notes: Notes) -> None:
    """Replaces the notes in a folder."""
    atomic.write_json(folder / NOTES, {"tags": sorted(set(notes.tags)), "note": notes.note})


def failure(run: RunFolder) -> str:
    """Why the last attempt of a run failed, in one line; empty if it did not. Raises DamagedFile."""
    return records.read(run.failure, Failure).error if run.failure.exists() else ""


@contextmanager
def noting_failure(attempted: Sequence[RunFolder]) -> Iterator[None]:
    """Writes the error that ends an attempt of runs into their folders; removes it after a success."""
    try:
        yield
    except Exception as error:
        text = " ".join(str(error).split())
        for run in attempted:
            if not run.config.exists():
                continue
            with suppress(OSError):  # A full disk, for example, must not hide the error itself.
                atomic.write_json(run.failure, Failure(f"{type(error).__name__}: {text}"))
                run_times.note_end(run)
        raise
    for run in attempted:
        run.failure.unlink(missing_ok=True)
