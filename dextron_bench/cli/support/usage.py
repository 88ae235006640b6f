"""Wrong arguments in one line: tyro says only that they do not fit, and this module finds what is wrong.

It names the nearest flag or command of an unknown one, a value that is not of its type, and what is missing.
"""

from __future__ import annotations

import dataclasses
import difflib
import io
import math
import types
import typing
from collections.abc import Collection, Iterable, Sequence
from contextlib import redirect_stderr
from typing import Any, TypeVar

import tyro

FIELD = "method_settings"  # Of commands, for the settings of a method. Its name is no flag, and methods have others.
T = TypeVar("T")

LARGEST_PORT = 65535
LARGEST = 2**31 - 1  # Threads, rows and seeds are such numbers in the libraries, too.


class BadNumber(ValueError):
    """A number that a flag cannot have."""


class BadName(ValueError):
    """An argument whose bytes are no text."""


def check_numbers(command: Any) -> None:
    """Raises BadNumber if a flag that takes numbers has one that is negative or too large: all of them are amounts."""
    for field in dataclasses.fields(command):
        value = getattr(command, field.name)
        largest = LARGEST_PORT if field.name == "port" else LARGEST
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, int | float) and not 0 <= number <= largest:
                limit = f"at most {largest}" if number > largest else "0 or more"
                raise BadNumber(f"--{field.name.replace('_', '-')} is {number}; it must be {limit}")


def fault(command: type, words: Sequence[str]) -> str:
    """One line about what is wrong with the words that follow a command's name."""
    if unknown := unknown_flags(words, flags(command)):
        return _unknown(unknown[0], flags(command))
    options = _options(command)
    given, places = _split(options, words)
    for option, values in given:
        if problem := option.problem(values):
            return problem
    positional = [option for option in options if option.is_positional]
    required = [option for option in positional if option.is_required]
    takes_all = any(option.takes_many for option in positional)
    if len(places) > len(positional) and not takes_all:
        return _unknown(places[len(positional)], ())
    missing = [option.name for option in required[len(places) :]]
    flagged = {option.name for option, _ in given}
    missing += [one.name for one in options if one.is_required and not one.is_positional and one.name not in flagged]
    if missing:
        return f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
    return _refusal(command, given) or "these flags and values do not go together"


def parse(command: type[T], words: Sequence[str]) -> T:
    """The dataclass that the words give; raises SystemExit if they do not fit, and prints nothing."""
    with redirect_stderr(io.StringIO()):
        return tyro.cli(command, args=words)


def _refusal(command: type, given: Sequence[tuple[Option, list[str]]]) -> str:
    """Why a dataclass among a command's fields refuses its values, such as the settings of a method; empty if none."""
    hints = typing.get_type_hints(command, include_extras=True)
    parts = (_part(field, hints[field.name]) for field in dataclasses.fields(command))
    for part in filter(None, parts):
        fields = {field.name: field for field in dataclasses.fields(part)}
        try:
            part(
                **{
                    option.field.name: _converted(_bare(option.hint), values or [str(option.field.default is not True)])
                    for option, values in given
                    if fields.get(option.field.name) is option.field
                }
            )
        except ValueError as error:
            return " ".join(str(error).split())
    return ""


@dataclasses.dataclass(frozen=True, slots=True)
class Option:
    """A flag or a positional argument of a command: its name there, and its field with its type."""

    name: str
    field: dataclasses.Field[Any]
    hint: Any

    @property
    def is_positional(self) -> bool:
        """True if its values stand without a flag."""
        return not self.name.startswith("--")

    @property
    def is_required(self) -> bool:
        """True if it has no default."""
        return self.field.default is dataclasses.MISSING and self.field.default_factory is dataclasses.MISSING

    @property
    def takes_many(self) -> bool:
        """True for a list of values."""
        return typing.get_origin(_bare(self.hint)) is tuple

    @property
    def takes_none(self) -> bool:
        """True for a flag that has no value."""
        return _bare(self.hint) is bool

    def problem(self, values: Sequence[str]) -> str:
        """What is wrong with the values that follow the flag; empty if nothing is."""
        if self.takes_none and not values:
            return ""
        if not values and not self.takes_many:
            return f"{self.name} needs a value"
        wanted = expected(self.hint)
        refused = next((value for value in values if not _fits(self.hint, value)), None)
        return f"{self.name}: {refused!r} is not {wanted}" if refused is not None else ""


def expected(hint: Any) -> str:
    """What values of a type are, in words."""
    hint = _bare(hint)
    if typing.get_origin(hint) is tuple:
        return expected(typing.get_args(hint)[0])
    if typing.get_origin(hint) is typing.Literal:
        return f"one of {', '.join(map(str, typing.get_args(hint)))}"
    return {int: "a whole number", float: "a number", bool: "True or False"}.get(hint, "a value that fits")


def _fits(hint: Any, value: str) -> bool:
    """True if a text is one value of a type, as tyro converts it."""
    hint = _bare(hint)
    part = typing.get_args(hint)[0] if typing.get_origin(hint) is tuple else hint
    try:
        _converted(part, [value])
    except (SystemExit, ValueError, TypeError):
        return False
    return True


def _converted(hint: Any, values: Sequence[str]) -> Any:
    """The value that texts give a field of a type; raises SystemExit if they do not fit."""
    one = dataclasses.make_dataclass("One", [("value", tyro.conf.FlagConversionOff[hint])])
    return parse(one, ["--value", *values]).value


def _bare(hint: Any) -> Any:
    """A type without what is annotated, and without None."""
    while hasattr(hint, "__metadata__"):
        hint = hint.__origin__
    if typing.get_origin(hint) in (types.UnionType, typing.Union):
        parts = [part for part in typing.get_args(hint) if part is not type(None)]
        return _bare(parts[0]) if len(parts) == 1 else hint
    return hint


def _split(options: Sequence[Option], words: Sequence[str]) -> tuple[list[tuple[Option, list[str]]], list[str]]:
    """The flags with the values that follow them, and the other words; a list of values ends at the next flag."""
    by_name = {option.name: option for option in options if not option.is_positional}
    by_name |= {f"--no-{name.removeprefix('--')}": one for name, one in by_name.items() if one.takes_none}
    given: list[tuple[Option, list[str]]] = []
    others: list[str] = []
    room = 0.0  # How many more values the last flag takes.
    for word in words:
        flag, equals, value = word.partition("=")
        if option := by_name.get(flag.replace("_", "-")):
            given.append((option, [value] if equals else []))
            room = 0 if option.takes_none or equals else math.inf if option.takes_many else 1
        elif room > 0:
            given[-1][1].append(word)
            room -= 1
        else:
            others.append(word)
    return given, others


def unknown_word(words: Sequence[str], known: Collection[str]) -> str:
    """The line about a first word that is none of the `known` commands, or about one that is missing."""
    return _unknown(words[0], known) if words else "the name of a command is missing"


def unknown_flags(arguments: Iterable[str], known: Collection[str]) -> list[str]:
    """The flags among the arguments that are not `known`."""
    both = {*known, *(f"--no-{name.removeprefix('--')}" for name in known), "--help", "--debug"}
    given = [word.partition("=")[0].replace("_", "-") for word in arguments if word.startswith("--") and word != "--"]
    return [word for word in given if word not in both]


def _unknown(word: str, known: Iterable[str]) -> str:
    """A line about an unknown word, with the known words that are nearest."""
    close = difflib.get_close_matches(word, known, 3)
    likeness = [difflib.SequenceMatcher(None, one, word).ratio() for one in close]
    nearest = [one for one, ratio in zip(close, likeness, strict=True) if ratio == max(likeness)]
    kind = "flag" if word.startswith("-") else "word"
    return f"unknown {kind} {word}" + (f"; did you mean {' or '.join(nearest)}?" if nearest else "")


def flags(command: Any) -> list[str]:
    """The flags of a command, of the dataclasses among its fields, and of the settings of its method."""
    return [option.name for option in _options(command) if not option.is_positional]


def _options(command: Any) -> list[Option]:
    """The flags and positional arguments of a command, in the order of its fields."""
    if not dataclasses.is_dataclass(command):
        return []
    hints = typing.get_type_hints(command, include_extras=True)
    return [option for field in dataclasses.fields(command) for option in _options_of(field, hints[field.name])]


def _part(field: dataclasses.Field[Any], hint: Any) -> Any:
    """The dataclass whose fields are flags in the place of a field; None for another field."""
    inner = field.default_factory if field.name == FIELD else getattr(hint, "__origin__", hint)
    return inner if dataclasses.is_dataclass(inner) else None


def _options_of(field: dataclasses.Field[Any], hint: Any) -> list[Option]:
    """The options of a field; a field can have another name on the command line, which its type hint holds."""
    if part := _part(field, hint):
        return _options(part)
    if field.name == FIELD:
        return []
    metadata = getattr(hint, "__metadata__", ())
    if any(one is tyro.conf.Positional for one in metadata):
        names = [one.metavar for one in metadata if getattr(one, "metavar", None)]
        return [Option(names[0] if names else field.name.upper(), field, hint)]
    names = [name for part in metadata if (name := getattr(part, "name", None))]
    return [Option(f"--{name.replace('_', '-')}", field, hint) for name in names or [field.name]]
