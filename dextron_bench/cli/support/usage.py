"""Wrong arguments in one line: what tyro says in a box, and the nearest flag or command of the one that was meant."""

from __future__ import annotations

import dataclasses
import difflib
import re
import typing
from collections.abc import Collection, Iterable
from itertools import groupby
from typing import Any

from dextron_bench.cli.support.method_flags import FIELD

LARGEST_PORT = 65535
LARGEST = 2**31 - 1  # Threads, rows and seeds are such numbers in the libraries, too.
RULE = "-"  # Separates the parts of tyro's messages.
UNKNOWN = re.compile(r"Unrecognized (?:or misplaced )?options: ([^\s,;=]+)")


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


def one_line(box: str) -> str:
    """The message in a box that tyro draws with lines or in ASCII, without its title and without help on the flag."""
    rows = [row.strip(" │─╭╮╰╯") or RULE for row in box.replace("╮", f"\n{RULE}").splitlines() if row.strip()]
    parts = [" ".join(part) for rule, part in groupby(rows, lambda row: not row.strip(RULE)) if not rule]
    messages = [
        part.rstrip(".") for part in parts[1:] if not part.startswith(("Argument helptext", "For full helptext"))
    ]
    return "; ".join(messages) or " ".join(box.split())


def with_nearest(message: str, known: Iterable[str]) -> str:
    """The line about an unknown word with the nearest of the `known` flags or commands; other lines unchanged."""
    if not (match := UNKNOWN.match(message)):
        return message
    return _unknown(match[1], known)


def unknown_flag(arguments: Iterable[str], known: Collection[str]) -> str:
    """The line about the first flag that is not `known`; empty if all are."""
    both = {*known, *(f"--no-{name.removeprefix('--')}" for name in known), "--help", "--debug"}
    given = [word.partition("=")[0].replace("_", "-") for word in arguments if word.startswith("--") and word != "--"]
    unknown = [word for word in given if word not in both]
    return _unknown(unknown[0], known) if unknown else ""


def _unknown(word: str, known: Iterable[str]) -> str:
    """A line about an unknown word, with the known words that are nearest."""
    close = difflib.get_close_matches(word, known, 3)
    likeness = [difflib.SequenceMatcher(None, one, word).ratio() for one in close]
    nearest = [one for one, ratio in zip(close, likeness, strict=True) if ratio == max(likeness)]
    kind = "flag" if word.startswith("-") else "word"
    return f"unknown {kind} {word}" + (f"; did you mean {' or '.join(nearest)}?" if nearest else "")


def flags(command: Any) -> list[str]:
    """The flags of a command, of the dataclasses among its fields, and of the settings of its method."""
    if not dataclasses.is_dataclass(command):
        return []
    hints = typing.get_type_hints(command, include_extras=True)
    return [flag for field in dataclasses.fields(command) for flag in _flags_of(field, hints[field.name])]


def _flags_of(field: dataclasses.Field[Any], hint: Any) -> list[str]:
    """The flags of a field; a field can have another name on the command line, which its type hint holds."""
    if field.name == FIELD:
        return flags(field.default_factory)
    if dataclasses.is_dataclass(inner := getattr(hint, "__origin__", hint)):
        return flags(inner)
    names = [name for part in getattr(hint, "__metadata__", ()) if (name := getattr(part, "name", None))]
    return [f"--{name.replace('_', '-')}" for name in names or [field.name]]
