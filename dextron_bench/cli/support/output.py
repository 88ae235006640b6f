"""What commands print: results on stdout, progress on stderr."""

from __future__ import annotations

import io
import json
import math
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, ClassVar

from dextron_bench.cli.support.streams import json_output
from dextron_bench.storage.printable import printable, printable_line
from dextron_bench.storage.progress import Progress, no_progress

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 1000  # Columns of a table that is not printed on a terminal, so that no cell is folded.
LINE_PERIOD = 60.0  # [s] between lines of progress where there is no terminal.
RATE_PERIOD = 300.0  # [s] for the estimate of rate and time left; a block of a search takes up to a minute.


def print_table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[object]], optional: Sequence[str] = ()
) -> None:
    """Prints a table on stdout; columns of numbers are right-aligned.

    On a terminal that is too narrow, `optional` columns are left out, from the first on, and a line names them.
    """
    from rich.console import Console

    rows = [list(row) for row in rows]
    is_terminal, page = sys.stdout.isatty(), _Page()
    width = Console().width if is_terminal else WIDTH
    console = Console(file=page, width=width, force_terminal=is_terminal, soft_wrap=not is_terminal, markup=False)
    left_out: list[str] = []
    while True:
        shown = [index for index, column in enumerate(columns) if column not in left_out]
        table = _table(title, [columns[i] for i in shown], [[row[i] for i in shown] for row in rows])
        droppable = [column for column in optional if column in columns and column not in left_out]
        if (
            not droppable
            or console.measure(table, options=console.options.update(width=WIDTH)).maximum <= console.width
        ):
            break
        left_out.append(droppable[0])
    console.print(table)
    print(page.getvalue(), end="")
    if left_out:
        print(f"a wider terminal also shows: {', '.join(column for column in columns if column in left_out)}")


class _Page(io.StringIO):
    """Takes a table from Rich, which would end the process if the reader of stdout has left.

    Where stdout has no UTF-8, Rich draws with ASCII.
    """

    @property
    def encoding(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The encoding of stdout."""
        return sys.stdout.encoding or "utf-8"


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> Table:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for index, column in enumerate(columns):
        numbers = all(isinstance(row[index], (int, float)) for row in rows)
        table.add_column(column, justify="right" if numbers else "left", overflow="fold")
    for row in rows:
        table.add_row(*(f"{cell:.3f}" if isinstance(cell, float) else printable(str(cell)) for cell in row))
    return table


def print_markdown(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Prints a table as Markdown on stdout."""
    for row in (columns, ["---"] * len(columns), *rows):
        print(f"| {' | '.join(printable(cell) for cell in row)} |")


def print_warning(text: str) -> None:
    """Prints one line on stderr; text of a stranger shows no control characters and is cut."""
    with suppress(OSError):  # A full or closed stderr changes no exit code.
        print(f"dextron-bench: {printable_line(text)}", file=sys.stderr, flush=True)


def print_json(value: Any) -> None:
    """Prints a value as JSON on stdout; numbers that are not finite become null."""
    print(json.dumps(_plain(value), indent=1, allow_nan=False), file=json_output())


def _plain(value: Any) -> Any:
    """The value, with None for each number that JSON cannot write."""
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def progress_bar(title: str, quiet: bool = False) -> Iterator[Progress]:
    """Shows a bar with count, rate and time left on stderr, or a line each minute if stderr is no terminal."""
    if quiet:
        yield no_progress
        return
    if not sys.stderr.isatty():
        yield _Lines(title)
        return
    from rich import progress as rich
    from rich.console import Console

    columns = (
        rich.TextColumn("{task.description}"),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn("{task.fields[rate]}"),
        rich.TimeElapsedColumn(),
        rich.TextColumn("elapsed,"),
        rich.TimeRemainingColumn(),
        rich.TextColumn("left"),
        rich.TextColumn("{task.fields[note]}"),
    )
    with rich.Progress(*columns, console=Console(stderr=True), speed_estimate_period=RATE_PERIOD) as bars:
        task = bars.add_task(title, total=None, rate="", note="")

        def report(done: int, total: int, note: str = "") -> None:
            bars.update(task, completed=done, total=total or None, note=note)
            bars.update(task, rate=_rate(bars.tasks[0].speed))

        yield report


class _Lines:
    """A progress report that prints a line when LINE_PERIOD has passed since the last one of any report of the process.

    So many short pieces of work have a line each minute, too.
    """

    printed: ClassVar[float | None] = None  # When the last line was printed, or the first report began.

    def __init__(self, title: str) -> None:
        self._title, self._start = title, time.monotonic()
        self._first, self._last = -1, -1
        if _Lines.printed is None:
            _Lines.printed = self._start

    def __call__(self, done: int, total: int, note: str = "") -> None:
        now = time.monotonic()
        if done < self._last or self._first < 0:  # Other work begins; what was done before is not part of the rate.
            self._first, self._start = done, now
        self._last = done
        if now - (_Lines.printed or 0.0) < LINE_PERIOD:
            return
        _Lines.printed = now
        speed = (done - self._first) / (now - self._start) if now > self._start else 0.0
        left = f", {_duration(max(total - done, 0) / speed)} left" if total and speed else ""
        rate = f"{_rate(speed)}{left}" if speed else ""
        parts = f"{self._title}: {done}{f'/{total}' if total else ''}", rate, printable(note)
        print(", ".join(filter(None, parts)), file=sys.stderr, flush=True)


def _duration(seconds: float) -> str:
    """A duration in hours and minutes, or in seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min" if minutes else f"{rest} s"


def _rate(speed: float | None) -> str:
    """A speed [1/s] with two or three digits; empty if it is unknown."""
    return "" if speed is None else f"{speed:.0f}/s" if speed >= 100 else f"{speed:.2g}/s"
