"""Shares of work in pieces (`storage/pieces.py`): which pieces a process plays, and whether all are there."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass

from dextron_bench.storage.pieces import ListedWork
from dextron_bench.storage.progress import Progress

LISTED = 4  # Names in a message.


class BadShare(ValueError):
    """A share that does not exist, or flags that contradict each other."""


class MissingPieces(LookupError):
    """A merge that lacks pieces; the message names them."""


@dataclass(frozen=True, slots=True)
class Share:
    """The pieces that one of `of` processes does: those at the places `index`, `index` + `of`, `index` + 2 `of`, ..."""

    index: int = 0
    of: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.index < self.of:
            raise BadShare(f"share {self.index}/{self.of} does not exist; shares count from 0")

    @classmethod
    def parse(cls, text: str) -> Share:
        """The share that a text like 0/2 names; raises BadShare."""
        index, _, of = text.partition("/")
        if not (index.isdecimal() and of.isdecimal()):
            raise BadShare(f"share {text!r} is not like 0/2, the first of two")
        return cls(int(index), int(of))

    def has(self, place: int) -> bool:
        """True if the piece at a place, counted from 0, belongs to this share."""
        return place % self.of == self.index

    def __str__(self) -> str:
        return f"{self.index}/{self.of}"


def play(works: Sequence[ListedWork], share: Share, bar: Callable[[str], AbstractContextManager[Progress]]) -> str:
    """Plays the pieces of a share that are not done; returns how many the share has. `bar` shows each, by its title."""
    pieces = [(work, name) for work in works for name in work.names()]
    mine = [piece for place, piece in enumerate(pieces) if share.has(place)]
    done = {id(work): work.done() for work in works}
    for work, name in mine:
        if name not in done[id(work)]:
            with bar(work.title(name)) as report:
                work.play(name, report)
    return f"{len(mine)} of {len(pieces)} pieces"


def check(works: Sequence[ListedWork]) -> None:
    """Raises MissingPieces if a piece is not done."""
    names = [work.title(name) for work in works for name in work.names()]
    check_complete("the merge", names, {work.title(name) for work in works for name in work.done()})


def check_complete(what: str, names: Sequence[str], present: Collection[str]) -> None:
    """Raises MissingPieces if one of the names of pieces is not present."""
    if missing := [name for name in names if name not in present]:
        listed = ", ".join(itertools.islice(missing, LISTED)) + (", ..." if len(missing) > LISTED else "")
        raise MissingPieces(
            f"{what} lacks {len(missing)} of {len(names)} pieces: {listed}; run the shares that have them and put all "
            "folders together, or leave out --merge to do them here"
        )
