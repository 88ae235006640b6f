"""Summaries of recordings: their properties, or their damage. A separate process reads the files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dextron_bench.errors import Failed
from dextron_bench.processes import limited_process
from dextron_bench.reaches.setting import Setting
from dextron_bench.recording import reader_process, rrd_format
from dextron_bench.recording.episode_file import ENDS, BrokenRecording, Recording, Value, read
from dextron_bench.recording.rrd_file import APPLICATION, APPLICATIONS
from dextron_bench.recording.rrd_format import RrdFormat

NEEDED = (*Setting.__slots__, *ENDS, "steps", "episode_return", "outcome")  # Properties of every episode.
PAIR = "pair"  # Property of a file with two episodes, which is only for the viewer.
MEMORY = 2 * limited_process.GIBIBYTE  # [bytes] of address space. With one flipped bit Rerun 0.41 asked for 23 GB.
START, SECONDS = 60.0, 10.0  # [s] for all files and for each file.


@dataclass(frozen=True, slots=True)
class Summary:
    """Size [bytes] of a recording and the properties of its run and its episode, or in words why it cannot be read.

    A pair has one property, which names its two recordings.
    """

    file: Path
    size: int = 0
    properties: dict[str, Value] = field(default_factory=dict)
    damage: str = ""


def summarise(files: Iterable[Path], whole: bool = False, hashes: Mapping[Path, str] = {}) -> Iterator[Summary]:
    """The summary of each file, in order. Summaries report damage; only Failed is raised.

    By default only the properties are read, so changes of other values are not noticed. With `whole` all of a file is
    read and compared with its digest, and with its SHA-256 if that is in `hashes`.
    """
    for summary in _summaries(files, whole):
        yield _verified(summary, hashes.get(summary.file)) if whole and not summary.damage else summary


def screen(files: Iterable[Path]) -> Iterator[Summary]:
    """Summaries of files from others: a separate process decodes all of each file. Raises Failed."""
    return _summaries(files, whole=True)


def read_safely(file: Path) -> Recording:
    """The episode in a file that may be damaged: a separate process decodes it first.

    Raises BrokenRecording, Failed.
    """
    return read_screened(next(screen([file])))


def read_screened(summary: Summary) -> Recording:
    """The episode in a file with a summary from `screen`; raises BrokenRecording."""
    if summary.damage:
        raise BrokenRecording(summary.file, summary.damage)
    return read(summary.file)


def _summaries(files: Iterable[Path], whole: bool) -> Iterator[Summary]:
    files = list(files)
    formats = [rrd_format.look_at(file) for file in files]
    readable = [(file, form) for file, form in zip(files, formats, strict=True) if not form.fault]
    descriptions = _describe(readable, whole)
    for file, form in zip(files, formats, strict=True):
        yield Summary(file, damage=form.fault) if form.fault else _summary(file, form, next(descriptions))


def _verified(summary: Summary, sha256: str | None) -> Summary:
    """The summary, or the damage if the file's content does not match its digest. Pairs have no digest."""
    if PAIR in summary.properties:
        return summary
    try:
        read(summary.file, sha256)
    except BrokenRecording as error:
        return Summary(summary.file, damage=str(error).removeprefix(f"{summary.file}: "))
    return summary


def _describe(files: Sequence[tuple[Path, RrdFormat]], whole: bool) -> Iterator[dict[str, Any]]:
    """What the reader process prints for each file. If a file ends the process, a new one continues with the next."""
    while files:
        names = "".join(json.dumps([str(file), form.has_footer]) + "\n" for file, form in files).encode()
        seconds = START + SECONDS * len(files)
        try:
            done = limited_process.run(reader_process.__file__, ["whole"] if whole else [], names, MEMORY, seconds)
        except limited_process.NotStarted as error:
            raise Failed(f"recordings cannot be read: {error}") from error
        *lines, _ = done.output.decode().split("\n")  # Without a line that the end of the process has cut.
        yield from map(json.loads, lines)
        files = files[len(lines) :]
        if files:
            yield {"limit": f"the process that read it {done.ending}"}
            files = files[1:]


def _summary(file: Path, form: RrdFormat, description: dict[str, Any]) -> Summary:
    """The summary of a file from what the reader process printed."""
    if "limit" in description:  # Not proof of damage: the machine may lack memory, or be slow.
        return Summary(file, damage=f"cannot be read ({description['limit']})")
    if "error" in description:
        return Summary(file, damage=form.undecodable(description["error"].rpartition(f"{file}: ")[2]))
    applications, groups = description["applications"], description["properties"]
    others = [name for name in applications if name not in APPLICATIONS]
    if others or len(applications) != 1:
        content = ", ".join(others) or "several episodes"
        writer = "" if form.is_current else f", written by {form.writer}"
        return Summary(file, damage=f"is no recording of {APPLICATION}, but of {content}{writer}")
    if PAIR in groups:
        return Summary(file, file.stat().st_size, {PAIR: " | ".join(map(str, groups[PAIR].values()))})
    properties = groups.get("run", {}) | groups.get("episode", {})
    if missing := [name for name in NEEDED if name not in properties]:
        damage = f"is a recording of another version of {APPLICATION}: it lacks the property {missing[0]!r}"
        return Summary(file, damage=damage)
    return Summary(file, file.stat().st_size, properties)
