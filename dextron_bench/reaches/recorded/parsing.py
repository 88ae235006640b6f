"""Parses one published recording: a file with a JSON object on each line, and a file with its annotations."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from dextron_bench.errors import BadInput
from dextron_bench.reaches.reach import MIN_GAP, Reach, clean

TABLE = 0.2  # [m] height above the table of the plane from which recorded heights are measured.
NAME = re.compile(r"(\d\d)_[fn][lr]_(\d\d)")  # subject, trial, start marker
MARKERS, ANGLES = 16, 4  # Number of start markers, on a polar grid with 4 angles in each ring.
ANNOTATIONS = ("start", "reached", "top")
MIN_SAMPLES = 4  # The least that a cubic spline needs.
UNIT = 1e-3  # Largest accepted deviation from unit length; in the recordings it is below 1e-7.


class RecordingError(BadInput):
    """A file is not a valid recording; the message names the file, the line and the reason."""


def parse(name: str, samples: bytes, annotations: bytes) -> Reach:
    """The cleaned reach `name` (subject_trial_marker) from the bytes of its two files. Raises RecordingError."""
    file, notes = f"extracts/{name}.json", f"extracts/meta/{name}_meta.json"
    subject, ring, angle = subject_and_region(name)
    table = read_samples(file, samples)
    reached = read_annotations(notes, annotations)["reached"] - table[0, 0]
    times, positions, quaternions = clean(table[:, 0], table[:, 1:4] + [0.0, 0.0, TABLE], table[:, 4:])
    if len(times) < MIN_SAMPLES:
        raise RecordingError(f"{file}: has {len(times)} samples at least {MIN_GAP} s apart; {MIN_SAMPLES} are needed")
    if not 0 < reached < times[-1]:
        raise RecordingError(f"{notes}: line 1: 'reached' is outside the recording, {reached:.3f} s from its start")
    return Reach(name, times, positions, quaternions, float(reached), subject, ring, angle)


def subject_and_region(name: str) -> tuple[str, int, int]:
    """Subject, ring 0 (near) to 3 (far) and angle 0 (-x side) to 3 (-y side), from a name. Raises RecordingError."""
    match = NAME.fullmatch(name)
    if not match or not 1 <= int(match[2]) <= MARKERS:
        raise RecordingError(f"{name}: is not the name of a recording, SUBJECT_TRIAL_MARKER, like 01_fl_16")
    ring, angle = divmod(int(match[2]) - 1, ANGLES)
    return match[1], ring, angle


def read_samples(file: str, content: bytes) -> np.ndarray:
    """Rows (n, 8) of time [s], position [m] and unit quaternion wxyz, as recorded. Raises RecordingError."""
    rows: list[list[float]] = []
    lines = _text(file, content).split("\n")
    if lines[-1] == "":
        lines.pop()
    for number, line in enumerate(lines, start=1):
        row = _sample(f"{file}: line {number}", line)
        if rows and row[0] < rows[-1][0]:
            raise RecordingError(f"{file}: line {number}: time goes back from {rows[-1][0]} to {row[0]} s")
        rows.append(row)
    if not rows:
        raise RecordingError(f"{file}: line 1: the file is empty")
    return np.array(rows)


def read_annotations(file: str, content: bytes) -> dict[str, float]:
    """Times [s] of the annotations, on the clock of the recording. Raises RecordingError."""
    place = f"{file}: line 1"
    pairs = _json(place, _text(file, content))
    if not isinstance(pairs, list):
        raise RecordingError(f"{place}: is not a list of [name, seconds]")
    times: dict[str, float] = {}
    for number, pair in enumerate(pairs, start=1):
        if not (isinstance(pair, list) and len(pair) == 2 and isinstance(pair[0], str)):
            raise RecordingError(f"{place}: entry {number} is not [name, seconds]")
        if pair[0] in times and pair[0] in ANNOTATIONS:
            raise RecordingError(f"{place}: annotation {pair[0]!r} occurs twice")
        times[pair[0]] = _numbers(place, repr(pair[0]), pair[1:], 1)[0]
    for name in ANNOTATIONS:
        if name not in times:
            raise RecordingError(f"{place}: annotation {name!r} is missing")
    return times


def _sample(place: str, line: str) -> list[float]:
    sample = _json(place, line)
    if not isinstance(sample, dict):
        raise RecordingError(f"{place}: is not an object with t, x and q")
    for key in ("t", "x", "q"):
        if key not in sample:
            raise RecordingError(f"{place}: {key!r} is missing")
    quaternion = _numbers(place, "'q'", sample["q"], 4)
    if abs(sum(part * part for part in quaternion) ** 0.5 - 1) > UNIT:
        raise RecordingError(f"{place}: 'q' is not of unit length")
    return [*_numbers(place, "'t'", [sample["t"]], 1), *_numbers(place, "'x'", sample["x"], 3), *quaternion]


def _numbers(place: str, key: str, values: Any, length: int) -> list[float]:
    """The values as floats. Error messages name the place and the key."""
    if not isinstance(values, list) or len(values) != length:
        raise RecordingError(f"{place}: {key} is not {length} numbers")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise RecordingError(f"{place}: {key} holds a {type(value).__name__}, not a number")
        if not abs(value) < 1e12:  # Refuses also NaN, infinity, and integers too large for a float.
            raise RecordingError(f"{place}: {key} holds {str(value)[:40]}, not a finite number")
    return [float(value) for value in values]


def _json(place: str, text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{place}: is not JSON, or is truncated ({error})") from error


def _text(file: str, content: bytes) -> str:
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise RecordingError(f"{file}: line {line}: is not UTF-8 text") from error
