"""Text that may come from a stranger, as it may be printed and published.

Control characters can drive a terminal, and characters that change the direction of text can make a line show other
words than it holds. `printable` writes each of them as a visible escape, such as `\\x1b`.
"""

from __future__ import annotations

import unicodedata

HIDDEN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")  # Unicode categories without a visible sign.
JOINERS = "\N{ZERO WIDTH NON-JOINER}\N{ZERO WIDTH JOINER}"  # Names in some scripts need them.
LONGEST = 2000  # Characters of a line that is printed.
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # Beginnings of a cell that a spreadsheet computes.


def printable_line(text: str) -> str:
    """The text as one line that may be printed: printable, and cut after LONGEST characters."""
    cut = len(text) - LONGEST
    return printable(text) if cut <= 0 else f"{printable(text[:LONGEST])}... and {cut} more characters"


def first_hidden(text: str) -> str:
    """The first character without a visible sign; empty if there is none."""
    return next((character for character in text if _is_hidden(character)), "")


def printable(text: str) -> str:
    """The text with a visible escape for each character that has no visible sign."""
    return "".join(_escape(character) if _is_hidden(character) else character for character in text)


def spreadsheet_cell(text: str) -> str:
    """The text as a cell of a table: a spreadsheet shows it and does not compute it."""
    return f"'{printable(text)}" if text.startswith(FORMULA) else printable(text)


def _is_hidden(character: str) -> bool:
    return unicodedata.category(character) in HIDDEN and character not in JOINERS


def _escape(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")
