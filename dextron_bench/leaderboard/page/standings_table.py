"""The page's main table: a row for each method, source of reaches and split."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dextron_bench.leaderboard.highlights import Shown
from dextron_bench.leaderboard.page import svg
from dextron_bench.leaderboard.page.html import UNKNOWN, Html, join, tag
from dextron_bench.leaderboard.page.rows import QUOTED, Entry

Links = Mapping[str, Sequence[Shown]]


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its heading, what of an entry is sorted by (None comes last), and what a cell shows."""

    title: str
    value: Callable[[Entry], Any]
    show: Callable[[Entry], str | Html]
    number: bool = False
    hint: str | None = None


def table(entries: Sequence[Entry], links: Links) -> Html:
    """The whole table, sorted as the entries are; readable without any script."""
    columns = _columns({name for entry in entries for name in entry.scores}, links)
    head = tag("thead", tag("tr", *(_heading(column) for column in columns)))
    body = tag("tbody", *(_row(entry, columns) for entry in entries))
    about = "Scores of methods by source of reaches and split, with 95 % intervals. Headings sort."
    return tag("table", tag("caption", about, class_="unseen"), head, body, id="standings")


def _columns(known: set[str], links: Links) -> list[Column]:
    """The columns, those of ranks, interquartile means and regrets only where the leaderboard has them."""
    shown = [
        Column("rank", _score("rank"), lambda entry: _plain(entry, "rank", "d"), True, "shared if not told apart"),
        Column("method", lambda entry: entry.method.lower(), _method),
        Column("return", _score("return"), _return, True, "of 20, 95 % interval"),
        Column("success", _score("success"), _success, True, "%, 95 % interval"),
        Column("IQM", _score("iqm"), lambda entry: _plain(entry, "iqm", ".2f"), True, "interquartile mean"),
        Column("regret", _score("regret"), lambda entry: _plain(entry, "regret", ".2f"), True, "against experts"),
        Column("reaches", lambda entry: entry.reaches, lambda entry: entry.reaches),
        Column("split", lambda entry: entry.split, _split),
        Column("tier", lambda entry: entry.tier, lambda entry: tag("span", entry.tier, class_="tier")),
        Column("seeds", _score("seeds"), lambda entry: _plain(entry, "seeds", "d"), True),
        Column("frames", lambda entry: entry.frames, lambda entry: _count(entry.frames), True, "trained on"),
        Column("demos", lambda e: e.demonstrations, lambda e: _count(e.demonstrations), True, "used"),
        Column("wall time", lambda entry: entry.seconds, _compute, True, "and hardware"),
        Column("privileged", lambda e: e.privileged, lambda e: e.privileged or UNKNOWN, False, "access declared"),
        Column("recordings", lambda e: len(links.get(e.method, ())), lambda e: _links(e, links), True),
    ]
    return [
        each for each in shown if each.title.lower() not in ("rank", "iqm", "regret") or each.title.lower() in known
    ]


def _heading(column: Column) -> Html:
    hint = tag("small", column.hint) if column.hint else None
    button = tag("button", column.title, type="button", data_sort="number" if column.number else "text")
    kind = "number" if column.number else None
    return tag("th", button, hint, scope="col", aria_sort="none", class_=kind, data_name=column.title)


def _row(entry: Entry, columns: Sequence[Column]) -> Html:
    cells = []
    for column in columns:
        value = column.value(entry)
        about = {"data_name": column.title, "class_": "number" if column.number else None}
        about["data_value"] = None if value is None or value != value else str(value)
        name, more = ("th", {"scope": "row"}) if column.title == "method" else ("td", {})
        cells.append(tag(name, column.show(entry), **about, **more))
    kind = "quoted" if entry.tier == QUOTED else entry.role
    marks = {"data_reaches": entry.reaches, "data_split": entry.split, "data_tier": entry.tier, "class_": kind}
    return tag("tr", *cells, **marks)


def _score(name: str) -> Callable[[Entry], Any]:
    return lambda entry: entry.scores.get(name)


def _plain(entry: Entry, name: str, form: str) -> str:
    value = entry.scores.get(name)
    if value is None or value != value:
        return UNKNOWN
    return format(int(value) if form == "d" else value, form)


def _method(entry: Entry) -> Html:
    mark = "quoted" if entry.tier == QUOTED else entry.role
    note = tag("small", entry.note) if entry.note else None
    return join(tag("span", entry.method, class_="name"), tag("span", mark, class_="mark") if mark else None, note)


def _split(entry: Entry) -> str:
    return "the paper's own" if entry.tier == QUOTED else entry.split


def _return(entry: Entry) -> Html:
    value, low, high = (entry.scores.get(f"return{end}") for end in ("", "_low", "_high"))
    interval = tag("span", f"[{low:.2f}, {high:.2f}]", class_="range") if low is not None else None
    text = tag("span", tag("b", f"{value:.2f}"), " ", interval, class_="figure")
    return join(text, svg.estimate(value or 0.0, low, high, 20.0))


def _success(entry: Entry) -> Html:
    value, low, high = (entry.scores.get(f"success{end}") for end in ("", "_low", "_high"))
    interval = None
    if low is not None and high is not None:
        interval = tag("span", f"[{100 * low:.1f}, {100 * high:.1f}]", class_="range")
    return join(tag("b", f"{100 * (value or 0.0):.1f}"), " ", interval)


def _count(value: int | None) -> str:
    return UNKNOWN if value is None else f"{value:,}"


def _compute(entry: Entry) -> Html:
    """How long training took, and on what."""
    seconds, shown = entry.seconds, UNKNOWN
    if seconds is not None:
        shown = f"{seconds / 3600:.1f} h" if seconds >= 3600 else f"{seconds / 60:.0f} min"
    return join(shown, tag("small", entry.hardware) if entry.hardware else None)


def _links(entry: Entry, links: Links) -> str | Html:
    """The method's recordings, with the source of reaches where it is another than the row's."""
    found = links.get(entry.method, ()) if entry.tier != QUOTED else ()
    if not found:
        return UNKNOWN
    where = "".join(dict.fromkeys(each.reaches for each in found if each.reaches != entry.reaches))
    note = tag("small", f"on {where} reaches") if where else None
    return join(*(tag("a", each.kind, href=each.address) for each in found), note)
