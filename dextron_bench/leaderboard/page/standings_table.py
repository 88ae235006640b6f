"""The page's main table: a row for each method, source of reaches and split."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from dextron_bench.leaderboard.highlights import Shown
from dextron_bench.leaderboard.page.rows import QUOTED, PageRow
from dextron_bench.scores import cells
from dextron_bench.web import svg
from dextron_bench.web.html import UNKNOWN, Html, join, tag

Links = Mapping[str, Sequence[Shown]]
Code = Mapping[tuple[str, str], Sequence[str]]  # Paths from the page, by method and source of reaches.
OPTIONAL = ("iqm", "regret", "code")  # Columns that appear only if some row has them.


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its heading, the value of an entry to sort by (None comes last), and the content of its cell."""

    title: str
    value: Callable[[PageRow], Any]
    show: Callable[[PageRow], str | Html]
    number: bool = False
    hint: str | None = None


def table(entries: Sequence[PageRow], links: Links, code: Code) -> Html:
    """The whole table in the order of the entries; readable without a script."""
    known = {name for entry in entries for name, value in entry.scores.items() if value == value}
    columns = _columns(known | ({"code"} if code else set()), links, code)
    head = tag("thead", tag("tr", *(_heading(column) for column in columns)))
    body = tag("tbody", *(_row(entry, columns) for entry in entries))
    caption = "Scores of methods by source of reaches and split, with 95 % intervals. Click a heading to sort."
    return tag("table", tag("caption", caption, class_="unseen"), head, body, id="standings")


def _columns(names: set[str], links: Links, code: Code) -> list[Column]:
    columns = [
        Column("method", lambda entry: entry.method.lower(), _method),
        Column("return", _score("return"), _return, True, "of 20, 95 % interval"),
        Column("success", _score("success"), _success, True, "%, 95 % interval"),
        Column("IQM", _score("iqm"), _interquartile_mean, True, "interquartile mean"),
        Column(
            "regret", _score("regret"), lambda entry: cells.regret(entry.scores) or UNKNOWN, True, "against experts"
        ),
        Column("reaches", lambda entry: entry.reaches, lambda entry: entry.reaches),
        Column("split", lambda entry: entry.split, _split),
        Column("tier", lambda entry: entry.tier, _tier),
        Column("seeds", _score("seeds"), lambda entry: _count(entry.scores.get("seeds")), True),
        Column("frames", lambda entry: entry.frames, lambda entry: _count(entry.frames), True, "trained on"),
        Column("demos", lambda entry: entry.demonstrations, lambda entry: _count(entry.demonstrations), True, "used"),
        Column("wall time", lambda entry: entry.seconds, _wall_time, True, "and hardware"),
        Column("privileged", lambda entry: entry.privileged, _privileged, False, "access declared"),
        Column("recordings", lambda entry: len(links.get(entry.method, ())), lambda entry: _links(entry, links), True),
        Column("code", lambda entry: len(_files(entry, code)), lambda entry: _code(entry, code), False, "submitted"),
    ]
    return [column for column in columns if column.title.lower() in names or column.title.lower() not in OPTIONAL]


def _heading(column: Column) -> Html:
    hint = tag("small", column.hint) if column.hint else None
    button = tag("button", column.title, type="button", data_sort="number" if column.number else "text")
    kind = "number" if column.number else None
    return tag("th", button, hint, scope="col", aria_sort="none", class_=kind, data_name=column.title)


def _row(entry: PageRow, columns: Sequence[Column]) -> Html:
    row = []
    for column in columns:
        value = column.value(entry)
        attributes: dict[str, str | None] = {
            "data_name": column.title,
            "class_": "number" if column.number else None,
            "data_value": None if value is None or (isinstance(value, float) and math.isnan(value)) else str(value),
        }
        is_method = column.title == "method"
        row.append(
            tag("th" if is_method else "td", column.show(entry), **attributes, scope="row" if is_method else None)
        )
    kind = "quoted" if entry.tier == QUOTED else entry.role
    return tag("tr", *row, data_reaches=entry.reaches, data_split=entry.split, data_tier=entry.tier, class_=kind)


def _score(name: str) -> Callable[[PageRow], Any]:
    return lambda entry: entry.scores.get(name)


def _method(entry: PageRow) -> Html:
    mark = "quoted" if entry.tier == QUOTED else entry.role
    note = tag("small", entry.note) if entry.note else None
    return join(tag("span", entry.method, class_="name"), tag("span", mark, class_="mark") if mark else None, note)


def _tier(entry: PageRow) -> Html:
    return join(tag("span", entry.tier, class_="tier"), tag("small", entry.equal) if entry.equal else None)


def _split(entry: PageRow) -> str:
    return "the paper's own" if entry.tier == QUOTED else entry.split


def _return(entry: PageRow) -> Html:
    """The mean return with its interval, as text and as a drawing."""
    value, low, high = (entry.scores.get(f"return{end}") for end in ("", "_low", "_high"))
    text = tag("span", _with_interval(cells.mean_return(entry.scores)), class_="figure")
    return join(text, svg.estimate(value or 0.0, low, high, 20.0))


def _success(entry: PageRow) -> Html:
    return _with_interval(cells.success(entry.scores))


def _with_interval(score: cells.Score) -> Html:
    return join(tag("b", score.value), " ", tag("span", score.interval, class_="range") if score.interval else None)


def _interquartile_mean(entry: PageRow) -> str:
    return cells.interquartile_mean(entry.scores).value or UNKNOWN


def _count(value: int | None) -> str:
    return UNKNOWN if value is None else f"{value:,}"


def _wall_time(entry: PageRow) -> Html:
    """The time and the hardware of training."""
    text = UNKNOWN
    if entry.seconds is not None:
        hours = entry.seconds / 3600
        text = f"{hours:.1f} h" if hours >= 1 else f"{entry.seconds / 60:.0f} min"
    return join(text, tag("small", entry.hardware) if entry.hardware else None)


def _privileged(entry: PageRow) -> str:
    return entry.privileged or UNKNOWN


def _links(entry: PageRow, links: Links) -> str | Html:
    """Links to the method's recordings; names their source of reaches if the row has another one."""
    shown = links.get(entry.method, ()) if entry.tier != QUOTED else ()
    if not shown:
        return UNKNOWN
    others = "".join(dict.fromkeys(recording.reaches for recording in shown if recording.reaches != entry.reaches))
    note = tag("small", f"on {others} reaches") if others else None
    return join(*(tag("a", recording.kind, href=recording.address) for recording in shown), note)


def _files(entry: PageRow, code: Code) -> Sequence[str]:
    """The paths from the page to the files of a submission's agent."""
    return code.get((entry.method, entry.reaches), ()) if entry.tier != QUOTED else ()


def _code(entry: PageRow, code: Code) -> str | Html:
    """Links to the files of a submission's agent."""
    files = _files(entry, code)
    return join(*(tag("a", file.rpartition("/")[2], href=quote(file)) for file in files)) if files else UNKNOWN
