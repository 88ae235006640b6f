"""Summaries of recordings: their properties, or their damage. A separate process reads the files."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dextron_bench.reaches.setting import Setting
from dextron_bench.recording import reader_process
from dextron_bench.recording.episode_file import ENDS, BrokenRecording, Recording, Value, read
from dextron_bench.recording.rrd_file import APPLICATION, APPLICATIONS
from dextron_bench.storage import limited_process

NEEDED = (*Setting.__slots__, *ENDS, "steps", "episode_return", "outcome")  # Properties of every episode.
PAIR = "pair"  # Property of a file with two episodes, which is only for the viewer.
MAGIC, FOOT = b"RRF2", b"FOOT"  # An .rrd file starts with MAGIC and has FOOT before its last four bytes.
MEMORY = 4 * limited_process.GIBIBYTE  # [bytes] of address space. With one flipped bit Rerun 0.41 asked for 23 GB.
START, SECONDS = 60.0, 10.0  # [s] to start and for each file.
HEAD = 12  # [bytes] size of an .rrd file's header.


class ReaderError(RuntimeError):
    """The process that reads recordings cannot start."""


@dataclass(frozen=True, slots=True)
class Summary:
    """Size [bytes] of a recording and the properties of its run and its episode, or its damage in words.

    A pair has one property, which names its two recordings.
    """

    file: Path
    size: int = 0
    properties: dict[str, Value] = field(default_factory=dict)
    damage: str = ""


def summarise(files: Iterable[Path], whole: bool = False, hashes: Mapping[Path, str] = {}) -> Iterator[Summary]:
    """The summary of each file, in order. Summaries report damage; only ReaderError is raised.

    By default only the properties are read, so changes of other values are not noticed. With `whole` all of a file is
    read and compared with its digest, and with its SHA-256 if that is in `hashes`.
    """
    for summary in _summaries(files, whole):
        yield _verified(summary, hashes.get(summary.file)) if whole and not summary.damage else summary


def screen(files: Iterable[Path]) -> Iterator[Summary]:
    """Summaries of files from others: a separate process decodes all of each file. Raises ReaderError."""
    return _summaries(files, whole=True)


def read_safely(file: Path) -> Recording:
    """The episode in a file that may be damaged: a separate process decodes it first.

    Raises BrokenRecording, ReaderError.
    """
    return read_screened(next(screen([file])))


def read_screened(summary: Summary) -> Recording:
    """The episode in a file with a summary from `screen`; raises BrokenRecording."""
    if summary.damage:
        raise BrokenRecording(summary.file, summary.damage)
    return read(summary.file)


def _summaries(files: Iterable[Path], whole: bool) -> Iterator[Summary]:
    files = list(files)
    faults = [_format_fault(file) for file in files]
    descriptions = _describe([file for file, fault in zip(files, faults, strict=True) if not fault], whole)
    for file, fault in zip(files, faults, strict=True):
        yield Summary(file, damage=fault) if fault else _summary(file, next(descriptions))


def _verified(summary: Summary, sha256: str | None) -> Summary:
    """The summary, or the damage if the file's content does not match its digest. Pairs have no digest."""
    if PAIR in summary.properties:
        return summary
    try:
        read(summary.file, sha256)
    except BrokenRecording as error:
        return Summary(summary.file, damage=str(error).removeprefix(f"{summary.file}: "))
    return summary


def _format_fault(file: Path) -> str:
    """The fault that a file's first and last bytes show; empty if it may be a recording."""
    if not file.is_file():
        return "is no file" if file.exists() else "there is no such file"
    try:
        with file.open("rb") as stream:
            head = stream.read(HEAD)
            stream.seek(-min(len(head), 8), os.SEEK_END)
            tail = stream.read()
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    if not head:
        return "is empty"
    if head[:4] != MAGIC[: len(head)]:
        is_rrd = head[:3] == MAGIC[:3]
        return "is an .rrd file of another version of Rerun" if is_rrd else "is no .rrd file"
    if tail[:4] != FOOT:
        return "is cut short: it has no footer"
    return ""


def _describe(files: Sequence[Path], whole: bool) -> Iterator[dict[str, Any]]:
    """What the reader process prints for each file. If a file ends the process, a new one continues with the next."""
    while files:
        names = "".join(json.dumps(str(file)) + "\n" for file in files).encode()
        seconds = START + SECONDS * len(files)
        done = limited_process.run(reader_process.__file__, ["whole"] if whole else [], names, MEMORY, seconds)
        *lines, _ = done.output.decode().split("\n")  # Without a line that the end of the process has cut.
        if not lines:
            raise ReaderError(f"recordings cannot be read: {' '.join(done.errors.split()[-30:])}")
        yield from map(json.loads, lines[1:])
        files = files[len(lines) - 1 :]
        if files:
            yield {"error": f"the process that read it {done.ending}"}
            files = files[1:]


def _summary(file: Path, description: dict[str, Any]) -> Summary:
    """The summary of a file from what the reader process printed."""
    if "error" in description:
        return Summary(file, damage=f"is damaged ({description['error'].rpartition(f'{file}: ')[2]})")
    applications, groups = description["applications"], description["properties"]
    others = [name for name in applications if name not in APPLICATIONS]
    if others or len(applications) != 1:
        content = ", ".join(others) or "several episodes"
        return Summary(file, damage=f"is no recording of {APPLICATION}, but of {content}")
    if PAIR in groups:
        return Summary(file, file.stat().st_size, {PAIR: " | ".join(map(str, groups[PAIR].values()))})
    properties = groups.get("run", {}) | groups.get("episode", {})
    if missing := [name for name in NEEDED if name not in properties]:
        damage = f"is a recording of another version of {APPLICATION}: it lacks the property {missing[0]!r}"
        return Summary(file, damage=damage)
    return Summary(file, file.stat().st_size, properties)
