"""How verbs speak: results on stdout, progress on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

WIDE = 1000  # Columns that a table may take off a terminal, where nothing is folded for want of room.
RATE_OVER = 300.0  # [s] over which rate and time left are estimated; a search's blocks take up to a minute.


def print_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A table on stdout; numbers are set right."""
    from rich.console import Console
    from rich.table import Table

    rows = [list(row) for row in rows]
    table = Table(title=title, title_justify="left")
    for place, column in enumerate(columns):
        numbers = all(isinstance(row[place], (int, float)) for row in rows)
        table.add_column(column, justify="right" if numbers else "left", overflow="fold")
    for row in rows:
        table.add_row(*(f"{cell:.3f}" if isinstance(cell, float) else str(cell) for cell in row))
    console = Console(width=None if sys.stdout.isatty() else WIDE, soft_wrap=not sys.stdout.isatty(), markup=False)
    with console.capture() as captured:  # Rich itself would end the process where a reader has left.
        console.print(table)
    print(captured.get(), end="")


def print_json(value: Any) -> None:
    """A value for programs on stdout."""
    print(json.dumps(value, indent=1))


class Told(Protocol):
    """Hears how far something is, and how it goes."""

    def __call__(self, done: int, total: int, note: str = "") -> None: ...


@contextmanager
def progress_bar(title: str, quiet: bool = False) -> Iterator[Told]:
    """A bar with count, rate and time left on stderr, told of (done, all); silent when quiet or off a terminal."""
    if quiet or not sys.stderr.isatty():
        yield lambda done, total, note="": None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        *(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}")),
        *(TimeElapsedColumn(), TextColumn("gone,"), TimeRemainingColumn(), TextColumn("left")),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns, console=Console(stderr=True), speed_estimate_period=RATE_OVER) as bars:
        task = bars.add_task(title, total=None, rate="", note="")

        def told(done: int, total: int, note: str = "") -> None:
            bars.update(task, completed=done, total=total or None, note=note)
            bars.update(task, rate=_rate(bars.tasks[0].speed))

        yield told


def _rate(speed: float | None) -> str:
    """A speed [1/s] with two or three digits; nothing while it is not known."""
    return "" if speed is None else f"{speed:.0f}/s" if speed >= 100 else f"{speed:.2g}/s"
