"""What every file that is read must hold: the schemas of JSON files and headers, and their checks.

A schema is a function that takes a value and raises Mismatch if the value does not have its form. Entries that a schema
does not name may hold anything. Bundles, which come from strangers, have stricter schemas in `dextron_bench/data`.
The columns of tables are in `storage.tables`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from dextron_bench.storage import atomic, tensors

Schema = Callable[[Any], None]
FULL_RETURN = 20.0  # The largest sum of rewards of an episode, `world.task.SUCCESS`.
LARGEST = 2**53  # Whole numbers up to this are exact as float64.


class Mismatch(ValueError):
    """A value that does not have the form of its schema."""

    def __init__(self, why: str, place: tuple[str, ...] = ()) -> None:
        self.why, self.place = why, place
        super().__init__(f"{'/'.join(place)} {why}" if place else f"it {why}")


def text(value: Any) -> None:
    """A text."""
    if not isinstance(value, str):
        raise Mismatch("is not text")


def flag(value: Any) -> None:
    """True or False."""
    if not isinstance(value, bool):
        raise Mismatch("is not true or false")


def moment(value: Any) -> None:
    """A date and a time with its zone, as ISO 8601 writes it."""
    text(value)
    try:
        zone = datetime.fromisoformat(value).tzinfo
    except ValueError:
        zone = None
    if zone is None:
        raise Mismatch("is not a time with its zone, such as 2026-01-31T12:00:00+00:00")


def number(low: float = -math.inf, high: float = math.inf) -> Schema:
    """A finite number from `low` to `high`."""
    limits = "a finite number" if low == -math.inf and high == math.inf else f"a number from {low:g} to {high:g}"

    def check(value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not -math.inf < value < math.inf:
            raise Mismatch(f"is not {limits}")
        if not low <= value <= high:
            raise Mismatch(f"is not {limits}")

    return check


def whole(low: int = 0) -> Schema:
    """A whole number, `low` or more."""

    def check(value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= LARGEST:
            raise Mismatch(f"is not a whole number, {low} or more")

    return check


def or_none(schema: Schema) -> Schema:
    """What a schema accepts, or null."""
    return lambda value: None if value is None else schema(value)


def list_of(schema: Schema, shortest: int = 0) -> Schema:
    """A list whose values have one form."""

    def check(value: Any) -> None:
        if not isinstance(value, list) or len(value) < shortest:
            raise Mismatch(f"is not a list of {shortest} or more values")
        for place, part in enumerate(value):
            _check_part(schema, part, str(place))

    return check


def map_of(schema: Schema, shortest: int = 0) -> Schema:
    """An object with any names, whose values have one form."""

    def check(value: Any) -> None:
        if not isinstance(value, dict) or len(value) < shortest:
            raise Mismatch(f"is not an object with {shortest} or more entries")
        for name, part in value.items():
            _check_part(schema, part, str(name))

    return check


def entries(needed: Mapping[str, Schema], others: Mapping[str, Schema] | None = None) -> Schema:
    """An object with the entries `needed`; an entry of `others` may be absent."""
    schemas = {**needed, **(others or {})}

    def check(value: Any) -> None:
        if not isinstance(value, dict):
            raise Mismatch("is not an object")
        if lacking := [name for name in needed if name not in value]:
            raise Mismatch(f"lacks {lacking[0]!r}")
        for name, schema in schemas.items():
            if name in value:
                _check_part(schema, value[name], name)

    return check


def anything(value: Any) -> None:
    """Any value."""


RETURN, COUNT, AMOUNT = number(0.0, FULL_RETURN), whole(), number(0.0, 1e300)
OBJECT = map_of(anything)
MACHINE = entries({}, {"system": text, "cpu": text, "cores": or_none(COUNT)})
CODE = entries({"class": text, "sha256": or_none(text)})
MAKER = {
    **dict.fromkeys(("physics", "python"), text),
    **{"git": or_none(text), "dirty": or_none(flag)},
    **{"versions": map_of(or_none(text)), "machine": MACHINE},
}
PROVENANCE = entries({}, {**MAKER, "seconds": AMOUNT, "others": list_of(entries({}, MAKER))})
TRAINING = entries(
    {},
    {
        **dict.fromkeys(("label", "reaches", "sha256"), text),
        **dict.fromkeys(("epochs", "best_epoch"), COUNT),
        **dict.fromkeys(("frames", "demonstrations", "seconds"), or_none(AMOUNT)),
        "seeds": list_of(COUNT),
    },
)
DECLARED = entries(
    {},
    {
        **dict.fromkeys(("authors", "notes", "url", "hardware"), or_none(text)),
        **dict.fromkeys(("frames", "demonstrations", "hours"), or_none(AMOUNT)),
    },
)
SPLIT_SCORES = entries(
    {
        "digest": text,
        "scores": list_of(RETURN, 1),
        "failed": COUNT,
        "causes": map_of(COUNT),
        "closing_lag": or_none(number()),
    },
    {"actions": list_of(text)},
)
FRESH_SCORES = entries({"digest": text, "scores": list_of(RETURN, 1)})
FRESH = entries({"beacon": text, "submission": text, "splits": map_of(FRESH_SCORES)})
FRESH_SETTINGS = entries({"beacon": text, "submission": text, "rows": COUNT})
RESULT = entries(
    {"method": text, "reaches": text, "seed": COUNT, "splits": map_of(SPLIT_SCORES, 1)},
    {
        **{"tier": text, "privileged": or_none(text), "declared": or_none(DECLARED), "provenance": PROVENANCE},
        "fresh": FRESH,
        **{"training": or_none(TRAINING), "maker": entries({}, {"method": text, "settings": OBJECT, "code": CODE})},
    },
)
POINT = entries({"epoch": COUNT, "return": RETURN, "success": number(0.0, 1.0)})
CURVE = entries({"points": list_of(POINT)}, {"split": text})
ACTIONS = list_of(list_of(number(-1.0, 1.0)))
VAL_SCORES = entries({"digest": text, "scores": list_of(RETURN, 1)}, {"sha256": text, "actions": ACTIONS})
CONFIG = entries(
    {}, {"method": text, "reaches": text, "seed": COUNT, "settings": OBJECT, "defaults": OBJECT, "physics": text}
)
METHOD_CONFIG = entries({"code": CODE, "settings": OBJECT, "physics": text})
SEARCH = entries({"search": OBJECT, "physics": text})
RECORDINGS = map_of(text)
ESTIMATE = entries(dict.fromkeys(("mean", "low", "high"), RETURN))
TRIAL = entries(
    {
        **{"settings": OBJECT, "run": text, "state": text, "error": text},
        "val": entries({"failed": COUNT}, {"return": ESTIMATE, "success": ESTIMATE}),
        "points": list_of(entries({"epoch": COUNT, "return": RETURN})),
    }
)
SWEEP = entries(
    {
        "question": entries({"method": text, "reaches": text, "settings": OBJECT, "space": OBJECT, "physics": text}),
        "trials": list_of(TRIAL),
        "winner": or_none(entries({"trial": COUNT, "run": text, "split": text})),
        **dict.fromkeys(("choice", "flags"), text),
    }
)
LEFT_OUT = entries({"depends on": OBJECT, "scores": list_of(RETURN, 1), "failed": COUNT})
PIECE = entries({"name": text, "depends on": OBJECT, "code": text, "files": map_of(text), "provenance": PROVENANCE})
FINDING = entries({"done": text, "problems": list_of(text), "actions": map_of(list_of(text))})
NOTES = entries({"tags": list_of(text), "note": text})
FAILURE = entries({"error": text})
TIMES = entries({}, dict.fromkeys(("began", "ended"), moment))
MANIFEST = entries({"name": text, "reaches": text, "seeds": list_of(COUNT, 1)}, {"declared": DECLARED})
CHECKPOINT = entries({"epoch": COUNT, "epochs": COUNT, "device": text}, {"files": map_of(text)})
SNAPSHOT = entries({"epoch": COUNT}, {"frames": or_none(AMOUNT)})
METRIC = entries({"epoch": COUNT, "seed": COUNT})
DURATION = entries({"what": text, "seconds": AMOUNT}, {"memory": AMOUNT, "device_memory": AMOUNT})
TRACKER = entries({"points": COUNT, "evaluations": COUNT, "dropped": COUNT, "error": text, "over": flag})
FIT_POINT = entries({"epoch": COUNT, **dict.fromkeys(("loss", "accuracy", "test_loss", "test_accuracy"), number())})
FIT = entries({"fit": OBJECT, "rows": COUNT, "epoch": COUNT, "curve": list_of(FIT_POINT, 1), "best_epoch": COUNT})
STEP = entries({"inputs": text, "outputs": map_of(text)})


def read(file: Path, schema: Schema) -> dict[str, Any]:
    """Reads a JSON object of a known form from a file; raises DamagedFile."""
    content = atomic.read_json(file)
    try:
        schema(content)
    except Mismatch as error:
        raise atomic.OtherForm(file, error) from error
    return content


def read_about(file: Path, schema: Schema) -> dict[str, Any]:
    """The metadata of a file of tensors, if it has a known form; raises BadTensors, OtherTensors, OSError."""
    about = tensors.read_about(file)
    try:
        schema(about)
    except Mismatch as error:
        raise tensors.OtherTensors(file, error) from error
    return about


def rows(content: bytes, schema: Schema) -> Iterator[dict[str, Any] | None]:
    """The JSON object in each line; None for a line that does not have the form of the schema."""
    for line in content.splitlines():
        try:
            row = json.loads(line)
            schema(row)
        except (ValueError, RecursionError):
            row = None
        yield row


def _check_part(schema: Schema, value: Any, name: str) -> None:
    """Checks a value inside another; names its place."""
    try:
        schema(value)
    except Mismatch as error:
        raise Mismatch(error.why, (name, *error.place)) from None
