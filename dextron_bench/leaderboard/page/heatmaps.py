"""Success by subject and by start region: a table for each source of reaches and split, shaded like a heat map."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.leaderboard.page.html import UNKNOWN, Html, tag
from dextron_bench.splits import strata
from dextron_bench.splits.loading import EVALUATED, known_splits, load_split
from dextron_bench.world import task

RINGS, ANGLES = range(4), range(4)


def successes(results: Iterable[dict[str, Any]]) -> dict[tuple[str, str], pd.DataFrame]:
    """The success rate of every row for each method (columns), mean over seeds, by source of reaches and split.

    Beside them are the strata of the row. Results on another version of a split are left out.
    """
    found: dict[tuple[str, str], dict[str, list[np.ndarray]]] = defaultdict(lambda: defaultdict(list))
    for result in results:
        for name, each in result["splits"].items():
            if _same(result["reaches"], name, each):
                solved = np.equal(np.asarray(each["scores"], float), task.SUCCESS).astype(float)
                found[result["reaches"], name][result["method"]].append(solved)
    return {key: _beside(key, methods) for key, methods in found.items()}


def maps(table: pd.DataFrame, methods: Sequence[str], name: str) -> Iterator[Html]:
    """The tables of a source and split, `name` in words: by subject where there are several, and by start region."""
    subjects = sorted(table["subject"].unique())
    if len(subjects) > 1:
        rates = table.groupby("subject")[list(methods)].mean().to_dict("index")
        head = tag("tr", _corner(), *(tag("th", subject, scope="col") for subject in subjects))
        counts = table["subject"].value_counts()
        cells = [rates[subject] for subject in subjects]
        yield _map(f"By subject, {name}", [head], cells, [int(counts[subject]) for subject in subjects], methods)
    rates = table.groupby(["ring", "angle"])[list(methods)].mean().to_dict("index")
    regions = [rates.get((ring, angle)) for ring in RINGS for angle in ANGLES]
    counts = table.groupby(["ring", "angle"]).size()
    settings = [int(counts.get((ring, angle), 0)) for ring in RINGS for angle in ANGLES]
    titles = ("ring 0, near", "ring 1", "ring 2", "ring 3, far")
    rings = tag("tr", _corner(2), *(tag("th", ring, scope="colgroup", colspan=4) for ring in titles))
    angles = tag("tr", *(tag("th", angle, scope="col", class_=_edge(angle)) for _ in RINGS for angle in ANGLES))
    yield _map(f"By start region (ring, angle), {name}", [rings, angles], regions, settings, methods, grouped=True)


def _same(reaches: str, name: str, found: dict[str, Any]) -> bool:
    return name in EVALUATED and name in known_splits(reaches) and _digest(reaches, name) == found["digest"]


def _digest(reaches: str, name: str) -> str:
    return load_split(reaches, name).digest


def _beside(key: tuple[str, str], methods: dict[str, list[np.ndarray]]) -> pd.DataFrame:
    rates = pd.DataFrame({method: np.mean(seeds, axis=0) for method, seeds in methods.items()})
    return pd.concat([strata.strata(load_split(*key)), rates], axis=1)


def _map(
    title: str,
    head: list[Html],
    cells: Sequence[Mapping[Hashable, float] | None],
    settings: Sequence[int],
    methods: Sequence[str],
    grouped: bool = False,
) -> Html:
    """A table of success [%], a row for each method, and below it how many settings each column has."""
    rows = []
    for method in methods:
        shown = [
            _cell(None if each is None else float(each[method]), _edge(place) if grouped else None)
            for place, each in enumerate(cells)
        ]
        rows.append(tag("tr", tag("th", method, scope="row"), *shown))
    counted = (tag("td", count, class_=_edge(place) if grouped else None) for place, count in enumerate(settings))
    foot = tag("tfoot", tag("tr", tag("th", "settings", scope="row"), *counted))
    return tag("table", tag("caption", title), tag("thead", *head), tag("tbody", *rows), foot, class_="heat")


def _cell(rate: float | None, edge: str | None) -> Html:
    if rate is None:
        return tag("td", UNKNOWN, class_=edge)
    return tag("td", f"{100 * rate:.0f}", class_=edge, style=f"--rate:{100 * rate:.0f}%", data_value=f"{rate:.4f}")


def _edge(place: int) -> str | None:
    """The class of a ring's first column."""
    return "edge" if place % len(ANGLES) == 0 else None


def _corner(rows: int = 1) -> Html:
    return tag("th", "success %", scope="col", rowspan=rows)
