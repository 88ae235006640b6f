"""Methods under tracks: a shaded table for each source of reaches and split."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from dextron_bench.evaluation.results import Result
from dextron_bench.scores import robustness
from dextron_bench.scores.robustness import Robustness
from dextron_bench.splits.tracks import TRACKS
from dextron_bench.web.html import UNKNOWN, Html, tag
from dextron_bench.world import task


def matrices(results: Iterable[Result]) -> Iterator[tuple[str, str, str, Html]]:
    """Source, split, title and the table of mean returns, methods by tracks, for each split that was played so."""
    rows = robustness.table(results)
    for reaches, split in dict.fromkeys((row.reaches, row.split) for row in rows):
        group = [row for row in rows if (row.reaches, row.split) == (reaches, split)]
        title = f"Return under tracks, {split} of {reaches} reaches"
        yield reaches, split, title, _matrix(title, group)


def _matrix(title: str, rows: Sequence[Robustness]) -> Html:
    names = [name for name in TRACKS if any(name in row.returns for row in rows)]
    heads = ("return", "seeds", "plain", *names, "area over delays")
    head = tag("tr", *(tag("th", text, scope="col") for text in heads))
    body = (tag("tr", tag("th", row.method, scope="row"), *_cells(row, names)) for row in rows)
    return tag("table", tag("caption", title), tag("thead", head), tag("tbody", *body), class_="heat")


def _cells(row: Robustness, names: Sequence[str]) -> Iterator[Html]:
    yield tag("td", str(row.seeds))
    yield _cell(row.plain)
    for name in names:
        if name not in row.returns:
            yield tag("td", UNKNOWN)
            continue
        loss = row.losses[name]
        yield _cell(row.returns[name], f"loses {loss.mean:.2f}, 95 % interval {loss.low:.2f} to {loss.high:.2f}")
    yield tag("td", UNKNOWN if math.isnan(row.area) else f"{row.area:.3f}", data_value=f"{row.area:.4f}")


def _cell(mean: float, loss: str | None = None) -> Html:
    shade = f"--rate:{100 * mean / task.SUCCESS:.0f}%"
    return tag("td", f"{mean:.1f}", style=shade, title=loss, data_value=f"{mean:.4f}")
