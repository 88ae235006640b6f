"""What recordings say of themselves: quickly, for many at once, and whatever is wrong with them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dextron_bench.reaches.setting import Setting
from dextron_bench.recording import reader_process
from dextron_bench.recording.episode_file import ENDS, BrokenRecording, Recording, Value, read
from dextron_bench.recording.rrd_file import APPLICATION, APPLICATIONS

NEEDED = (*Setting.__slots__, *ENDS, "steps", "episode_return", "outcome")  # Told of every episode.
PAIR = "pair"  # Property of two episodes in one file, which is for looking alone.
MAGIC, FOOT = b"RRF2", b"FOOT"  # An .rrd file begins with the one, and has the other before its last four bytes.
LEAST = 12  # [bytes] of an .rrd file's head.


class ReaderError(RuntimeError):
    """The process that reads recordings could not be started."""


@dataclass(frozen=True, slots=True)
class Summary:
    """A recording's size [bytes] and properties, those of its run and its episode; or what is wrong with it.

    Of a pair, the only property tells which two recordings it shows.
    """

    file: Path
    size: int = 0
    properties: dict[str, Value] = field(default_factory=dict)
    damage: str = ""


def summarise(files: Iterable[Path], whole: bool = False, hashes: Mapping[Path, str] = {}) -> Iterator[Summary]:
    """Each file's summary, in order; damage is told, not raised. Raises ReaderError.

    Only properties are read, so that a value changed elsewhere in a file goes unnoticed; unless `whole`,
    which reads everything and compares it with its digest, and with the file's SHA-256 among `hashes`.
    """
    for summary in _summaries(files, whole):
        yield _compared(summary, hashes.get(summary.file)) if whole and not summary.damage else summary


def screen(files: Iterable[Path]) -> Iterator[Summary]:
    """Summaries of files of unknown origin, each decoded whole, in a process of its own. Raises ReaderError."""
    return _summaries(files, whole=True)


def read_safely(file: Path) -> Recording:
    """The episode in a file of unknown origin; raises BrokenRecording, ReaderError."""
    return read_screened(next(screen([file])))


def read_screened(summary: Summary) -> Recording:
    """The episode in a file that `screen` summarised; raises BrokenRecording."""
    if summary.damage:
        raise BrokenRecording(summary.file, summary.damage)
    return read(summary.file)


def _summaries(files: Iterable[Path], whole: bool) -> Iterator[Summary]:
    files = list(files)
    forms = [_form(file) for file in files]
    told = _told([file for file, wrong in zip(files, forms, strict=True) if not wrong], whole)
    for file, wrong in zip(files, forms, strict=True):
        yield Summary(file, damage=wrong) if wrong else _summary(file, next(told))


def _compared(summary: Summary, sha256: str | None) -> Summary:
    """The summary of a file that can be decoded, once its content is held against its digest; pairs have none."""
    if PAIR in summary.properties:
        return summary
    try:
        read(summary.file, sha256)
    except BrokenRecording as error:
        return Summary(summary.file, damage=str(error).removeprefix(f"{summary.file}: "))
    return summary


def _form(file: Path) -> str:
    """What can be told to be wrong from a file's first and last bytes; nothing where it may be a recording."""
    if not file.is_file():
        return "is no file" if file.exists() else "there is no such file"
    try:
        with file.open("rb") as opened:
            head = opened.read(LEAST)
            opened.seek(-min(len(head), 8), os.SEEK_END)
            tail = opened.read()
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    if not head:
        return "is empty"
    if head[:4] != MAGIC[: len(head)]:
        other = head[:3] == MAGIC[:3]
        return "is an .rrd file of another version of Rerun" if other else "is no .rrd file"
    if tail[:4] != FOOT:
        return "is cut short, or its writing was: it has no footer"
    return ""


def _told(files: Sequence[Path], whole: bool) -> Iterator[dict[str, Any]]:
    """What `glance` tells of each file; where one ends its process, another goes on with the next file."""
    command = [sys.executable, "-P", reader_process.__file__, *(["whole"] if whole else [])]
    while files:
        names = "".join(json.dumps(str(file)) + "\n" for file in files)
        done = subprocess.run(command, input=names, capture_output=True, text=True, encoding="utf-8", check=False)
        lines = done.stdout.splitlines()
        if not lines:
            raise ReaderError(f"recordings cannot be read: {' '.join(done.stderr.split()[-30:])}")
        yield from map(json.loads, lines[1:])
        files = files[len(lines) - 1 :]
        if files:
            yield {"error": f"reading it ended the process that read it, with code {done.returncode}"}
            files = files[1:]


def _summary(file: Path, told: dict[str, Any]) -> Summary:
    if "error" in told:
        return Summary(file, damage=f"is damaged ({told['error'].rpartition(f'{file}: ')[2]})")
    others = [name for name in told["applications"] if name not in APPLICATIONS]
    if others or len(told["applications"]) != 1:
        return Summary(
            file, damage=f"is no recording of {APPLICATION}, but of {', '.join(others) or 'several episodes'}"
        )
    if PAIR in told["properties"]:
        return Summary(file, file.stat().st_size, {PAIR: " | ".join(map(str, told["properties"][PAIR].values()))})
    properties = told["properties"].get("run", {}) | told["properties"].get("episode", {})
    if lacking := [name for name in NEEDED if name not in properties]:
        return Summary(
            file, damage=f"is a recording of another version of {APPLICATION}: it does not tell its {lacking[0]}"
        )
    return Summary(file, file.stat().st_size, properties)
