"""Records: the typed contents of files, and reading them with checks.

A record is a msgspec struct whose fields are the entries of a JSON object. Entries that it does not name may hold
anything, and are lost when it is written. `atomic.write_json` writes records, and leaves out an entry that has its
default. The columns of tables are in `storage.tables`.
"""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta

from dextron_bench.errors import BadInput
from dextron_bench.storage import atomic

FULL_RETURN = 20.0  # The largest sum of rewards of an episode, `world.task.SUCCESS`.
LARGEST = 2**53  # Whole numbers up to this are exact as float64.
FINITE = 1e300
STEP = re.compile(r"\.([^.\[]+)|\[(\d+|\.\.\.)\]")  # A step of a path such as `$.splits[...].scores[1]`.

Count = Annotated[int, Meta(ge=0, le=LARGEST)]
Number = Annotated[float, Meta(ge=-FINITE, le=FINITE)]
Amount = Count | Annotated[float, Meta(ge=0.0, le=FINITE)]
Return = Annotated[float, Meta(ge=0.0, le=FULL_RETURN)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Scores = Annotated[list[Return], Meta(min_length=1)]
T = TypeVar("T")


class Record(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a file, or a part of one, holds."""


class Mismatch(BadInput):
    """A value that does not have the form of its record: `place` of the fault, empty for the whole, and `why`."""

    def __init__(self, place: str, why: str) -> None:
        self.place, self.why = place, why
        super().__init__(f"{place}: {why}" if place else why)


def convert(content: Any, kind: type[T]) -> T:
    """Parsed JSON as a record, or as another type; raises Mismatch."""
    try:
        return msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        raise Mismatch(*_fault(content, kind, str(error))) from None


def read(file: Path, kind: type[T]) -> T:
    """Reads a JSON object from a file as a record; raises DamagedFile."""
    content = atomic.read_json(file)
    try:
        return convert(content, kind)
    except Mismatch as error:
        raise atomic.OtherForm(file, error) from error


def read_about(file: Path, kind: type[T]) -> T:
    """The metadata of a file of tensors as a record; raises BadTensors, OtherTensors, OSError."""
    from dextron_bench.storage import tensors  # Loads NumPy, which the process that checks a bundle's JSON need not.

    about = tensors.read_about(file)
    try:
        return convert(about, kind)
    except Mismatch as error:
        raise tensors.OtherTensors(file, error) from error


def rows(content: bytes, kind: type[T]) -> Iterator[T | None]:
    """The record in each line; None for a line that does not have its form."""
    for line in content.splitlines():
        try:
            yield convert(json.loads(line), kind)
        except (ValueError, RecursionError):
            yield None


def _fault(content: Any, kind: type, message: str) -> tuple[str, str]:
    """The place that a message of msgspec names, as names and numbers between slashes, and the rest of the message."""
    why, _, path = message.rpartition(" - at ")
    if not why:
        return "", message
    content = value = copy.deepcopy(content)
    steps = []
    for match in STEP.finditer(path.strip("`")):
        step = match[1] or match[2]
        if step == "...":
            step = _wrong_entry(content, kind, value, message)
        steps.append(step)
        value = value[int(step)] if isinstance(value, list) else value.get(step)
    in_name = " (a name in it)" if path.startswith("`key`") else ""
    return f"{'/'.join(steps)}{in_name}", why


def _wrong_entry(content: Any, kind: type, part: dict[str, Any], message: str) -> str:
    """The name of the entry of an object inside the content that causes a message; removes all other entries."""
    for name, value in list(part.items()):
        part.clear()
        part[name] = value
        try:
            msgspec.convert(content, kind)
        except msgspec.ValidationError as error:
            if str(error) == message:
                return name
    return "..."
