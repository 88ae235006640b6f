"""What the page shows below its table: learning curves, endings, heat maps, ridge plots and recordings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.leaderboard import highlights
from dextron_bench.leaderboard.highlights import Shown
from dextron_bench.leaderboard.page import heatmaps
from dextron_bench.leaderboard.page import svg as page_svg
from dextron_bench.leaderboard.page.html import UNKNOWN, Html, join, tag
from dextron_bench.splits.loading import EVALUATED
from dextron_bench.success.exemplars import KINDS

Curves = Mapping[str, Mapping[str, Mapping[int, pd.DataFrame]]]  # By source of reaches, method and seed.


def curves(found: Curves, rows: pd.DataFrame) -> Iterator[Html]:
    """Learning curves, a picture for each source of reaches."""
    from dextron_bench.scores import figures

    for reaches, own in sorted(found.items()):
        here = rows[rows["reaches"] == reaches]
        methods = {method: dict(seeds) for method, seeds in own.items()}
        svg = figures.inline(lambda file, methods=methods, here=here: figures.learning_curves(methods, here, file))
        label = f"Learning curves on {reaches} reaches: return on val against epochs, of {', '.join(sorted(own))}"
        caption = tag("figcaption", f"{reaches} reaches")
        picture = _scroll(page_svg.picture(svg, f"curves-{reaches}", label), f"Learning curves on {reaches} reaches")
        yield tag("figure", picture, caption, data_reaches=reaches)


def endings(rows: pd.DataFrame) -> Iterator[Html]:
    """How episodes end: a bar and its numbers for each method, by source of reaches and split."""
    yield tag("ul", *(_key(place, cause) for place, cause in enumerate(CAUSES)), class_="legend")
    for reaches, split, group in _parts(rows):
        heads = ["method", "", *CAUSES, "closing lag [s]"]
        head = tag("tr", *(tag("th", title, scope="col") if title else tag("td", "") for title in heads))
        title = f"How episodes of {split} of {reaches} reaches end [%]"
        body = tag("tbody", *(_ending(row) for row in group.to_dict("records")))
        table = tag("table", tag("caption", title), tag("thead", head), body, class_="endings")
        yield tag("div", _scroll(table, title), data_reaches=reaches, data_split=split)


def heat(rows: pd.DataFrame, results: Iterable[dict[str, Any]]) -> Iterator[Html]:
    """Success by subject and start region, methods best first."""
    found = heatmaps.successes(results)
    for reaches, split, group in _parts(rows):
        if (reaches, split) in found:
            table, name = found[reaches, split], f"{split} of {reaches} reaches"
            methods = [method for method in dict.fromkeys(group["method"]) if method in table]
            maps = [_scroll(each, f"Success, {name}") for each in heatmaps.maps(table, methods, name)]
            yield tag("div", *maps, data_reaches=reaches, data_split=split)


def ridges(folder: Path, shown: list[Shown]) -> Iterator[Html]:
    """The ridge plots of the cases that explain the success model, with links to their recordings."""
    from dextron_bench.scores import figures

    seen = highlights.ridges(folder, shown)
    if not seen:
        return
    titled = {f"{kind}\n({each.player})": each for kind, each in seen.items()}
    svg = figures.inline(lambda file: figures.ridges(titled, file))
    label = f"Ridge plots of predicted success over actions and time: {'; '.join(seen)}"
    cases = sorted((each for each in shown if each.kind in KINDS), key=lambda each: [*KINDS].index(each.kind))
    links = join(*(_recording(each, f"{KINDS[each.kind]} ({each.method})") for each in cases))
    caption = tag("figcaption", "Their recordings: ", tag("span", links, class_="links"))
    yield tag("figure", _scroll(page_svg.picture(svg, "ridges", label), "Ridge plots"), caption)


def recordings(shown: list[Shown]) -> Iterator[Html]:
    """A table of the recordings of each method."""
    rows = [
        tag(
            "tr",
            tag("th", method, scope="row"),
            tag("td", _recording(each, each.kind)),
            *(tag("td", text) for text in (each.reaches, each.split)),
            *(tag("td", text, class_="number") for text in (str(each.row), f"{each.score:.2f}")),
            tag("td", each.outcome),
        )
        for method, own in sorted(highlights.by_method(shown).items())
        for each in own
    ]
    if rows:
        titles = ("method", "recording", "reaches", "split", "row", "return", "outcome")
        head = tag("tr", *(tag("th", title, scope="col") for title in titles))
        caption = tag("caption", "The shortest success and failure of each method among the first rows of a split")
        yield _scroll(tag("table", caption, tag("thead", head), tag("tbody", *rows)), "Recordings")


def _parts(rows: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """The rows of each source and split that ranks methods, in the order of the splits."""
    for reaches, own in rows.groupby("reaches"):
        for split in EVALUATED:
            group = own[own["split"] == split]
            if not group.empty:
                yield str(reaches), split, group


def _ending(row: Mapping[Any, Any]) -> Html:
    shares = [(cause, row[cause] / row["episodes"]) for cause in CAUSES]
    lag = UNKNOWN if pd.isna(row["closing_lag"]) else f"{row['closing_lag']:.2f}"
    cells = [tag("td", f"{100 * share:.1f}", class_="number", data_value=f"{share:.4f}") for _, share in shares]
    bar = tag("td", page_svg.shares(shares), class_="bar")
    return tag("tr", tag("th", row["method"], scope="row"), bar, *cells, tag("td", lag, class_="number"))


def _key(place: int, cause: str) -> Html:
    return tag("li", tag("i", class_=f"c{place}", aria_hidden="true"), cause)


def _recording(shown: Shown, text: str) -> Html:
    return tag("a", text, href=shown.address)


def _scroll(content: Html, name: str) -> Html:
    """A part that scrolls sideways by itself, reachable by keyboard."""
    return tag("div", content, class_="scroll", role="region", aria_label=name, tabindex=0)


def options(values: Sequence[str], chosen: str | None, every: str) -> Html:
    """The options of a choice, the first of them everything."""
    rest = (tag("option", value, selected="" if value == chosen else None) for value in values)
    return join(tag("option", every, value=""), *rest)
