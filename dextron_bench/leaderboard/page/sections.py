"""The sections below the page's table: learning curves, endings, heat maps, ridge plots and recordings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.evaluation.results import Result
from dextron_bench.leaderboard import highlights, readme
from dextron_bench.leaderboard.highlights import Shown
from dextron_bench.leaderboard.page import heatmaps as page_heatmaps
from dextron_bench.leaderboard.page import tracks as page_tracks
from dextron_bench.scores import cells
from dextron_bench.splits.names import EVALUATED
from dextron_bench.success.exemplars import KINDS
from dextron_bench.web import svg
from dextron_bench.web.html import UNKNOWN, Html, join, tag

RANK_TITLES = {  # By split: its heading beside the ranks.
    "unseen-reach": "new reaches",
    "unseen-subject": "new people",
    "hard": "hard",
    "test": "the paper's protocol",
}
Curves = Mapping[str, Mapping[str, Mapping[int, pd.DataFrame]]]  # By source of reaches, method and seed.


def ranks(ranked: pd.DataFrame) -> Iterator[Html]:
    """The ranks of the latest round: a table for each source, a row for each method."""
    if ranked.empty:
        yield tag("p", readme.NO_ROUND)
    for reaches, rows in ranked.groupby("reaches"):
        splits = [name for name in RANK_TITLES if rows[name].notna().any()]
        titles = ["rank", "method", "score", *(RANK_TITLES[name] for name in splits), "more of public test", "seeds"]
        head = tag("tr", *(tag("th", title, scope="col") for title in titles))
        body = tag("tbody", *(_ranked(row, splits) for row in rows.to_dict("records")))
        number, margin = rows["round"].iloc[0], 100 * rows["margin"].iloc[0]
        title = f"Round {number} on {reaches} reaches: success [%], margin of ranks {margin:.1f} points"
        table = tag("table", tag("caption", title), tag("thead", head), body, class_="ranks")
        yield tag("div", _scrollable(table, title), data_reaches=str(reaches))


def _ranked(row: Mapping[Any, Any], splits: Sequence[str]) -> Html:
    rank = cells.rank(row) or tag("small", row["unranked"])
    score = cells.score(row)
    scored = tag("td", tag("b", score.value), " ", tag("span", score.interval, class_="range"), class_="number")
    shares = [tag("td", cells.share(row, name) or UNKNOWN, class_="number") for name in splits]
    gaps = tag("td", ", ".join(f"{100 * gap:+.1f}" for gap in row["gaps"]) or UNKNOWN, class_="number")
    seeds = tag("td", str(row["seeds"]), class_="number")
    return tag("tr", tag("td", rank), tag("th", row["method"], scope="row"), scored, *shares, gaps, seeds)


def curves(by_source: Curves, rows: pd.DataFrame) -> Iterator[Html]:
    """Learning curves: a picture for each source of reaches."""
    from dextron_bench.scores.figures import pictures, training

    for reaches, by_method in sorted(by_source.items()):
        methods = {method: dict(seeds) for method, seeds in by_method.items()}
        source_rows = rows[rows["reaches"] == reaches]
        drawing = pictures.inline(lambda file, args=(methods, source_rows): training.learning_curves(*args, file))
        title = f"Learning curves on {reaches} reaches"
        label = f"{title}: return on val against epochs for {', '.join(training.without_parts(methods))}"
        picture = _scrollable(svg.picture(drawing, f"curves-{reaches}", label), title)
        yield tag("figure", picture, tag("figcaption", f"{reaches} reaches"), data_reaches=reaches)


def endings(rows: pd.DataFrame) -> Iterator[Html]:
    """How episodes end: a bar and its numbers for each method, by source of reaches and split."""
    yield tag("ul", *(_legend_entry(number, cause) for number, cause in enumerate(CAUSES)), class_="legend")
    for reaches, split, group in _ranking_groups(rows):
        heads = ["method", "", *CAUSES, "closing lag [s]"]
        head = tag("tr", *(tag("th", title, scope="col") if title else tag("td", "") for title in heads))
        title = f"How episodes of {split} of {reaches} reaches end [%]"
        body = tag("tbody", *(_ending(row) for row in group.to_dict("records")))
        table = tag("table", tag("caption", title), tag("thead", head), body, class_="endings")
        yield tag("div", _scrollable(table, title), data_reaches=reaches, data_split=split)


def heatmaps(rows: pd.DataFrame, results: Iterable[Result]) -> Iterator[Html]:
    """Success by subject and by start region, best methods first."""
    tables = page_heatmaps.successes(results)
    for reaches, split, group in _ranking_groups(rows):
        if (reaches, split) in tables:
            table, name = tables[reaches, split], f"{split} of {reaches} reaches"
            methods = [method for method in dict.fromkeys(group["method"]) if method in table]
            maps = [_scrollable(content, f"Success, {name}") for content in page_heatmaps.maps(table, methods, name)]
            yield tag("div", *maps, data_reaches=reaches, data_split=split)


def tracks(results: Iterable[Result]) -> Iterator[Html]:
    """Mean returns under tracks, methods by tracks."""
    for reaches, split, title, matrix in page_tracks.matrices(results):
        yield tag("div", _scrollable(matrix, title), data_reaches=reaches, data_split=split)


def ridges(folder: Path, shown: Sequence[Shown]) -> Iterator[Html]:
    """Ridge plots of the exemplars of the success model, with links to their recordings."""
    from dextron_bench.scores.figures import episodes as drawn_episodes
    from dextron_bench.scores.figures import pictures

    episodes = highlights.ridges(folder, shown)
    if not episodes:
        return
    titled = {f"{kind}\n({episode.player})": episode for kind, episode in episodes.items()}
    drawing = pictures.inline(lambda file: drawn_episodes.ridges(titled, file))
    label = f"Ridge plots of predicted success over actions and time: {'; '.join(episodes)}"
    exemplars = sorted(
        (recording for recording in shown if recording.kind in KINDS),
        key=lambda recording: [*KINDS].index(recording.kind),
    )
    links = join(*(_link(recording, f"{KINDS[recording.kind]} ({recording.method})") for recording in exemplars))
    caption = tag("figcaption", "Their recordings: ", tag("span", links, class_="links"))
    yield tag("figure", _scrollable(svg.picture(drawing, "ridges", label), "Ridge plots"), caption)


def recordings(shown: Sequence[Shown]) -> Iterator[Html]:
    """A table of the recordings of each method."""
    rows = [
        tag(
            "tr",
            tag("th", method, scope="row"),
            tag("td", _link(recording, recording.kind)),
            *(tag("td", text) for text in (recording.reaches, recording.split)),
            *(tag("td", text, class_="number") for text in (str(recording.row), f"{recording.score:.2f}")),
            tag("td", recording.outcome),
        )
        for method, group in sorted(highlights.by_method(shown).items())
        for recording in group
    ]
    if rows:
        titles = ("method", "recording", "reaches", "split", "row", "return", "outcome")
        head = tag("tr", *(tag("th", title, scope="col") for title in titles))
        caption = tag("caption", "The shortest success and failure of each method among the first rows of a split")
        yield _scrollable(tag("table", caption, tag("thead", head), tag("tbody", *rows)), "Recordings")


def _ranking_groups(rows: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """The rows of each source and each split that ranks methods, in the order of the splits."""
    for reaches, source_rows in rows.groupby("reaches"):
        for split in EVALUATED:
            group = source_rows[source_rows["split"] == split]
            if not group.empty:
                yield str(reaches), split, group


def _ending(row: Mapping[Any, Any]) -> Html:
    shares = [(cause, row[cause] / row["episodes"]) for cause in CAUSES]
    texts = zip(cells.cause_shares(row), shares, strict=True)
    numbers = [tag("td", text, class_="number", data_value=f"{share:.4f}") for text, (_, share) in texts]
    bar = tag("td", svg.shares(shares), class_="bar")
    lag = tag("td", cells.closing_lag(row) or UNKNOWN, class_="number")
    return tag("tr", tag("th", row["method"], scope="row"), bar, *numbers, lag)


def _legend_entry(number: int, cause: str) -> Html:
    return tag("li", tag("i", class_=f"c{number}", aria_hidden="true"), cause)


def _link(recording: Shown, text: str) -> Html:
    return tag("a", text, href=recording.address)


def _scrollable(content: Html, name: str) -> Html:
    """A part of the page that scrolls sideways by itself and has the keyboard's focus."""
    return tag("div", content, class_="scroll", role="region", aria_label=name, tabindex=0)
