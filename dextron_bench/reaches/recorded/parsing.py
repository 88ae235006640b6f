"""One recorded reach as published: a JSON object per line, and annotations in a file beside it."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from dextron_bench.reaches.reach import MIN_GAP, Reach, clean

TABLE = 0.2  # [m] recorded heights are above a plane this far above the table.
NAME = re.compile(r"(\d\d)_[fn][lr]_(\d\d)")  # subject, trial, start marker
MARKERS, ANGLES = 16, 4  # Start markers, on a polar grid with so many angles a ring.
ANNOTATIONS = ("start", "reached", "top")
MIN_SAMPLES = 4  # A cubic spline needs as many.
UNIT = 1e-3  # Quaternions may be this far from unit length; the recorder's were within 1e-7.


class RawError(ValueError):
    """A file that is not a recording; the message has its name, the line, and what is wrong there."""


def parse(name: str, samples: bytes, annotations: bytes) -> Reach:
    """The cleaned reach `name` (subject_trial_marker) from the bytes of its two files; raises RawError."""
    file, notes = f"extracts/{name}.json", f"extracts/meta/{name}_meta.json"
    subject, ring, angle = origin(name)
    table = read_samples(file, samples)
    reached = read_annotations(notes, annotations)["reached"] - table[0, 0]
    times, positions, quaternions = clean(table[:, 0], table[:, 1:4] + [0.0, 0.0, TABLE], table[:, 4:])
    if len(times) < MIN_SAMPLES:
        raise RawError(f"{file}: has {len(times)} samples apart by {MIN_GAP} s; {MIN_SAMPLES} are needed")
    if not 0 < reached < times[-1]:
        raise RawError(f"{notes}: line 1: 'reached' is outside the recording, {reached:.3f} s from its start")
    return Reach(name, times, positions, quaternions, float(reached), subject, ring, angle)


def origin(name: str) -> tuple[str, int, int]:
    """Subject, ring 0 (near) to 3 (far) and angle 0 (-x side) to 3 (-y side) of a recording; raises RawError."""
    match = NAME.fullmatch(name)
    if not match or not 1 <= int(match[2]) <= MARKERS:
        raise RawError(f"{name}: is not a recording's name, SUBJECT_TRIAL_MARKER, like 01_fl_16")
    ring, angle = divmod(int(match[2]) - 1, ANGLES)
    return match[1], ring, angle


def read_samples(file: str, content: bytes) -> np.ndarray:
    """Rows (n, 8) of time [s], position [m] and unit quaternion wxyz as recorded; raises RawError."""
    rows: list[list[float]] = []
    lines = _text(file, content).split("\n")
    if lines[-1] == "":
        lines.pop()
    for number, line in enumerate(lines, start=1):
        row = _sample(f"{file}: line {number}", line)
        if rows and row[0] < rows[-1][0]:
            raise RawError(f"{file}: line {number}: time goes back from {rows[-1][0]} to {row[0]} s")
        rows.append(row)
    if not rows:
        raise RawError(f"{file}: line 1: the file is empty")
    return np.array(rows)


def read_annotations(file: str, content: bytes) -> dict[str, float]:
    """Times [s] of the annotations, on the recording's clock; raises RawError."""
    where = f"{file}: line 1"
    pairs = _json(where, _text(file, content))
    if not isinstance(pairs, list):
        raise RawError(f"{where}: is not a list of [name, seconds]")
    found: dict[str, float] = {}
    for number, pair in enumerate(pairs, start=1):
        if not (isinstance(pair, list) and len(pair) == 2 and isinstance(pair[0], str)):
            raise RawError(f"{where}: entry {number} is not [name, seconds]")
        if pair[0] in found and pair[0] in ANNOTATIONS:
            raise RawError(f"{where}: annotation {pair[0]!r} is there twice")
        found[pair[0]] = _numbers(where, repr(pair[0]), pair[1:], 1)[0]
    for name in ANNOTATIONS:
        if name not in found:
            raise RawError(f"{where}: annotation {name!r} is missing")
    return found


def _sample(where: str, line: str) -> list[float]:
    sample = _json(where, line)
    if not isinstance(sample, dict):
        raise RawError(f"{where}: is not an object with t, x and q")
    for key in ("t", "x", "q"):
        if key not in sample:
            raise RawError(f"{where}: {key!r} is missing")
    quaternion = _numbers(where, "'q'", sample["q"], 4)
    if abs(sum(part * part for part in quaternion) ** 0.5 - 1) > UNIT:
        raise RawError(f"{where}: 'q' is not of unit length")
    return [*_numbers(where, "'t'", [sample["t"]], 1), *_numbers(where, "'x'", sample["x"], 3), *quaternion]


def _numbers(where: str, what: str, values: Any, length: int) -> list[float]:
    if not isinstance(values, list) or len(values) != length:
        raise RawError(f"{where}: {what} is not {length} numbers")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise RawError(f"{where}: {what} holds a {type(value).__name__}, not a number")
        if not abs(value) < 1e12:  # Also what is not finite, and integers too large for a float.
            raise RawError(f"{where}: {what} holds {str(value)[:40]}, not a finite number")
    return [float(value) for value in values]


def _json(where: str, text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RawError(f"{where}: is not JSON, or is cut short ({error})") from error


def _text(file: str, content: bytes) -> str:
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise RawError(f"{file}: line {line}: is not UTF-8 text") from error
