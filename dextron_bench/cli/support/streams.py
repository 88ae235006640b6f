"""Standard streams, so that no command stumbles over them: closed, full, without UTF-8, or read by a JSON parser."""

from __future__ import annotations

import ctypes
import io
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TextIO

JSON = "--json"
HELP = ("--help", "-h")

_json: list[TextIO] = []  # Where JSON goes while all other text goes to stderr.


def prepare() -> None:
    """Opens streams that are closed, as if they led nowhere, and lets none fail for a character that it lacks.

    Without this, the next file that is opened would take the place of a closed stream, and what a library prints
    would go into that file.
    """
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        with suppress(OSError):
            os.fstat(number)
            continue
        nowhere = os.open(os.devnull, os.O_RDONLY if mode == "r" else os.O_WRONLY)
        if nowhere != number:
            os.dup2(nowhere, number)
            os.close(nowhere)
        setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def give_up_output() -> None:
    """Lets a stream lead nowhere if what is written to it cannot be delivered: Python would complain at its end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)


@contextmanager
def only_json(words: Sequence[str]) -> Iterator[None]:
    """If the words of a command ask for JSON, stdout gets only that while the block lasts, and stderr all the rest.

    The rest is what agents and libraries print, in Python or in C.
    """
    if JSON not in words or any(word in HELP for word in words):
        yield
        return
    before, is_own = sys.stdout, _descriptor(sys.stdout) == 1
    before.flush()
    saved = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    copy = open(saved, "w", encoding="utf-8")  # noqa: SIM115 (closed below)
    _json.append(copy if is_own else before)
    try:
        yield
        _json[-1].flush()
    finally:
        _json.pop()
        sys.stdout = before
        ctypes.CDLL(None).fflush(None)  # What C's library holds back would follow the JSON at the end of the process.
        os.dup2(saved, 1)
        with suppress(OSError):  # Of a reader that has left, which the block has raised.
            copy.close()


def json_output() -> TextIO:
    """Where JSON goes."""
    return _json[-1] if _json else sys.stdout


def _descriptor(stream: TextIO) -> int | None:
    """The file descriptor of a stream; None if it has none."""
    try:
        return stream.fileno()
    except (OSError, ValueError):
        return None
