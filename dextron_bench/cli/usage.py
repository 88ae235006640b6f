"""Wrong arguments in one line: what tyro says in a box, and the nearest flag or command of the one that was meant."""

from __future__ import annotations

import dataclasses
import difflib
import re
from collections.abc import Iterable
from itertools import groupby
from typing import Any

from dextron_bench.cli.method_flags import FIELD

RULE = "-"  # Separates the parts of tyro's messages.
UNKNOWN = re.compile(r"Unrecognized (?:or misplaced )?options: ([^\s,;=]+)")


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
    word = match[1]
    [nearest] = difflib.get_close_matches(word, known, 1) or [""]
    kind = "flag" if word.startswith("-") else "word"
    return f"unknown {kind} {word}" + (f"; did you mean {nearest}?" if nearest else "")


def flags(command: Any) -> list[str]:
    """The flags of a command, and of the settings of its method if it has such."""
    if not dataclasses.is_dataclass(command):
        return []
    names = [field.name for field in dataclasses.fields(command)]
    settings = next((field.default_factory for field in dataclasses.fields(command) if field.name == FIELD), None)
    own_flags = [f"--{name.replace('_', '-')}" for name in names if name != FIELD]
    return own_flags + (flags(settings) if settings is not None else [])
