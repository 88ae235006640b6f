"""What `sweep --grid` and `sweep --search` say, with the types of the method's settings."""

from __future__ import annotations

import dataclasses
import shlex
import typing
from collections.abc import Mapping, Sequence
from typing import Any

import tyro

from dextron_bench.cli.support import usage
from dextron_bench.methods.settings import default
from dextron_bench.sweeps.space import BadSpace, Choices, Range, Space

BETWEEN, LOG = "..", ":log"  # As in 1e-4..1e-2:log.


def parse(settings: Any, grid: Sequence[str], search: Sequence[str]) -> Space:
    """The space that texts such as "near=0.04,0.06" and "near=0.04..0.08" describe; raises BadSpace.

    `settings` are the method's settings as flags gave them, or None for a method without settings. A setting that
    varies must keep its default there.
    """
    flag, texts = ("--grid", grid) if grid else ("--search", search)
    if not texts or (grid and search):
        raise BadSpace(
            "give --grid near=0.04,0.06 to try every combination, or --search near=0.04..0.08 to draw values"
        )
    space: dict[str, Choices | Range] = {}
    for text in texts:
        name, equals, values = text.partition("=")
        name = name.removeprefix("--").replace("-", "_")
        field = _field(settings, name)
        if not equals or not values or name in space:
            raise BadSpace(f"{flag} {text!r}: write each setting once, with its values, as in {name}=1,2")
        if getattr(settings, name) != default(field):
            raise BadSpace(f"--{name.replace('_', '-')} has a value of its own; leave it out, or do not vary {name!r}")
        space[name] = _part(flag, text, _parser(type(settings), field), values)
    if grid and (ranges := [name for name, part in space.items() if isinstance(part, Range)]):
        raise BadSpace(f"--grid {ranges[0]}: a grid needs values, as in {ranges[0]}=1,2; --search takes a range")
    return space


def _field(settings: Any, name: str) -> dataclasses.Field[Any]:
    """The field of a setting."""
    fields = {} if settings is None else {field.name: field for field in dataclasses.fields(settings)}
    if name not in fields:
        raise BadSpace(f"the method has no setting {name!r}; it has {', '.join(fields) or 'none'}")
    return fields[name]


def _part(flag: str, text: str, parser: type, values: str) -> Choices | Range:
    """The choices or the range that the values of one setting are."""
    numbers, log = values.removesuffix(LOG), values.endswith(LOG)
    low, between, high = numbers.partition(BETWEEN)
    if not between:
        return Choices(tuple(_value(flag, text, parser, value) for value in values.split(",")))
    ends = [_value(flag, text, parser, end) for end in (low, high)]
    if any(isinstance(end, bool) or not isinstance(end, (int, float)) for end in ends):
        raise BadSpace(f"{flag} {text!r}: only a number has a range; give values, as in 1,2")
    return Range(ends[0], ends[1], log)


def _parser(cls: type, field: dataclasses.Field[Any]) -> type:
    """A class with this field alone, so that its flag is parsed as `run` parses it; a boolean takes True or False."""
    hint: Any = _hints(cls).get(field.name, field.type)
    same = dataclasses.field(default_factory=lambda: default(field))
    return dataclasses.make_dataclass("Setting", [(field.name, tyro.conf.FlagConversionOff[hint], same)])


def _hints(cls: type) -> Mapping[str, Any]:
    return typing.get_type_hints(cls, include_extras=True)


def _value(flag: str, text: str, parser: type, value: str) -> Any:
    """The value that a text gives; raises BadSpace."""
    [field] = dataclasses.fields(parser)
    try:
        words = shlex.split(value)
    except ValueError as error:  # Of a quote without an end.
        raise BadSpace(f"{flag} {text!r}: {error}") from None
    words = [f"--{field.name.replace('_', '-')}", *words]
    try:
        return getattr(usage.parse(parser, words), field.name)
    except SystemExit:
        raise BadSpace(f"{flag} {text!r}: {usage.fault(parser, words)}") from None
