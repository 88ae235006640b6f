"""The page of episodes: a search, and a card for each episode. It needs no script."""

from __future__ import annotations

import math
from importlib.resources import files
from string import Template

import pandas as pd

from dextron_bench.catalogue.browse.search import ORDERS, Search
from dextron_bench.catalogue.episodes import COLUMNS, STATE
from dextron_bench.catalogue.expressions import BadExpression
from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.web.html import Html, join, style, tag

POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' data:; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'"
)
VALUES = 12  # Columns with more different values show their range.
EXAMPLE = "cause == 'too late' and subject == '04' and return < 5"


def document(episodes: pd.DataFrame, search: Search, token: str, target: str, notice: str = "") -> str:
    """The page's HTML; `token` is the secret of its forms, and `target` says where recordings open."""
    try:
        matching, error = search.matching(episodes), ""
    except BadExpression as problem:
        matching, error = episodes.iloc[:0], str(problem)
    values = {
        "style": _style(),
        "facts": _facts(episodes),
        "controls": _controls(search),
        "messages": join(*(tag("p", text, class_="message", role="alert") for text in (error, notice) if text)),
        "columns": _columns(episodes),
        "count": _count(len(matching), len(episodes)),
        "causes": _causes(matching, search),
        "cards": join(*(_card(key, row, search, token, target) for key, row in search.part(matching).iterrows())),
        "pages": _pages(search, search.pages(matching)),
    }
    template = files("dextron_bench.catalogue.browse").joinpath("page.html").read_text(encoding="utf-8")
    return Template(template).substitute(values)


def _style() -> Html:
    """The style of all pages, and what this page adds."""
    added = files("dextron_bench.catalogue.browse") / "page.css"
    return Html(style() + added.read_text(encoding="utf-8"))


def _facts(episodes: pd.DataFrame) -> Html:
    counts = {"episodes": len(episodes), "runs": episodes["run"].nunique(), "methods": episodes["method"].nunique()}
    words = ((number, name if number != 1 else name.removesuffix("s")) for name, number in counts.items())
    return join(*(tag("li", tag("b", _grouped(number)), " ", name) for number, name in words))


def _controls(search: Search) -> Html:
    options = (tag("option", name, selected="" if name == search.order else None) for name in ORDERS)
    where = tag(
        "input",
        type="text",
        name="where",
        value=search.where or None,
        placeholder=EXAMPLE,
        autocomplete="off",
        autocapitalize="off",
        spellcheck="false",
    )
    return join(
        tag("label", "episodes with", where, class_="where"),
        tag("label", "order", tag("select", join(*options), name="order")),
        tag("button", "search"),
    )


def _columns(episodes: pd.DataFrame) -> Html:
    """A table of the columns, what they say, and their values."""
    rows = (
        tag("tr", tag("th", name, scope="row"), tag("td", text), tag("td", _values(episodes[name])))
        for name, text in COLUMNS.items()
    )
    return tag("table", tag("tbody", join(*rows)))


def _values(column: pd.Series) -> str:
    """The different values of a column if they are few, otherwise their range."""
    known = sorted(value for value in column.unique() if value == value and value != "")
    if len(known) > VALUES:
        known = [known[0], "...", known[-1]]
    return ", ".join(f"{value:.3g}" if isinstance(value, float) else str(value) for value in known)


def _count(matching: int, total: int) -> str:
    return f"{_grouped(matching)} of {_grouped(total)} episodes"


def _causes(matching: pd.DataFrame, search: Search) -> Html:
    """A link for each cause that occurs, which narrows the search to it."""
    counts = matching["cause"].value_counts()
    return join(
        *(
            tag("li", _chip(cause), tag("a", cause, href=search.narrowed(f"cause == {cause!r}").address), f" {number}")
            for cause, number in ((cause, int(counts.get(cause, 0))) for cause in CAUSES)
            if number
        )
    )


def _chip(cause: str) -> Html:
    """The colour of a cause, as on the leaderboard."""
    return tag("i", class_=f"c{CAUSES.index(cause)}" if cause in CAUSES else None, aria_hidden="true")


def _card(key: object, row: pd.Series, search: Search, token: str, target: str) -> Html:
    """An episode: its last state, what it scored and why, and a button that opens its recording."""
    name = f"{row['method']} on row {row['row']} of {row['split']}"
    picture = tag("img", src=f"/picture/{key}.png", alt=f"Last state of {name}", width=320, height=240, loading="lazy")
    lag = "" if math.isnan(row["closing_lag"]) else f", closing lag {row['closing_lag']:+.2f} s"
    subject = f", subject {row['subject']}" if row["subject"] else ""
    return tag(
        "article",
        picture if row[STATE] is not None else None,
        tag("h3", row["method"]),
        tag("p", tag("b", f"{row['return']:g}"), " of 20 ", _chip(row["cause"]), row["cause"], class_="outcome"),
        tag("p", f"{row['reaches']}, {row['split']} {row['row']}, seed {row['seed']}{subject}"),
        tag("p", f"{row['steps']} steps{lag}"),
        tag("p", row["failure"]) if row["failure"] else None,
        _form(key, name, search, token, target) if row["steps"] else None,
        id=f"e{key}",
    )


def _form(key: object, name: str, search: Search, token: str, target: str) -> Html:
    """The button that opens a recording; the same search is shown again afterwards."""
    hidden = {"token": token, "where": search.where, "order": search.order, "page": search.page}
    fields = (tag("input", type="hidden", name=field, value=value) for field, value in hidden.items())
    button = tag("button", f"open {target}", aria_label=f"open the recording of {name} {target}")
    return tag("form", join(*fields), button, method="post", action=f"/open/{key}")


def _pages(search: Search, pages: int) -> Html:
    """Links to the pages before and after."""
    before, after = search.page - 1, search.page + 1
    return join(
        tag("a", "previous", href=search.at(min(before, pages)).address, rel="prev") if before >= 1 else None,
        tag("span", f"page {search.page} of {pages}"),
        tag("a", "next", href=search.at(after).address, rel="next") if after <= pages else None,
    )


def _grouped(number: int) -> str:
    """A number with a space between thousands."""
    return f"{number:,}".replace(",", "\N{NO-BREAK SPACE}")
