"""Success by subject and by start region: a shaded table for each source of reaches and split."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from dextron_bench.evaluation.results import Result
from dextron_bench.splits import strata
from dextron_bench.splits.loading import known_splits, load_split
from dextron_bench.splits.names import EVALUATED
from dextron_bench.web.html import UNKNOWN, Html, tag
from dextron_bench.world import task

RINGS, ANGLES = range(4), range(4)
RING_TITLES = ("ring 0, near", "ring 1", "ring 2", "ring 3, far")


def successes(results: Iterable[Result]) -> dict[tuple[str, str], pd.DataFrame]:
    """Success rate of every setting (rows) for each method (columns), mean over seeds, by source and split.

    Further columns hold the strata of the setting. Results on another version of a split are left out.
    """
    solved: dict[tuple[str, str], dict[str, list[np.ndarray]]] = defaultdict(lambda: defaultdict(list))
    for result in results:
        for name, played in result.splits.items():
            if _is_current(result.reaches, name, played.digest):
                seed = np.equal(np.asarray(played.scores, float), task.SUCCESS).astype(float)
                solved[result.reaches, name][result.method].append(seed)
    return {key: _with_strata(key, methods) for key, methods in solved.items()}


def maps(table: pd.DataFrame, methods: Sequence[str], name: str) -> Iterator[Html]:
    """The tables of a source and split, by subject if there are several, and by start region; `name` is its title."""
    subjects = sorted(table["subject"].unique())
    if len(subjects) > 1:
        yield _by_subject(table, subjects, methods, name)
    yield _by_region(table, methods, name)


def _by_subject(table: pd.DataFrame, subjects: Sequence[str], methods: Sequence[str], name: str) -> Html:
    rates = table.groupby("subject")[list(methods)].mean().to_dict("index")
    counts = table["subject"].value_counts()
    head = tag("tr", _corner(), *(tag("th", subject, scope="col") for subject in subjects))
    settings = [int(counts[subject]) for subject in subjects]
    return _heatmap(f"By subject, {name}", [head], [rates[subject] for subject in subjects], settings, methods)


def _by_region(table: pd.DataFrame, methods: Sequence[str], name: str) -> Html:
    rates = table.groupby(["ring", "angle"])[list(methods)].mean().to_dict("index")
    counts = table.groupby(["ring", "angle"]).size()
    regions = [(ring, angle) for ring in RINGS for angle in ANGLES]
    rings = tag("tr", _corner(2), *(tag("th", ring, scope="colgroup", colspan=4) for ring in RING_TITLES))
    angles = tag("tr", *(tag("th", angle, scope="col", class_=_edge(angle)) for _, angle in regions))
    settings = [int(counts.get(region, 0)) for region in regions]
    title = f"By start region (ring, angle), {name}"
    return _heatmap(title, [rings, angles], [rates.get(region) for region in regions], settings, methods, grouped=True)


def _is_current(reaches: str, name: str, digest: str) -> bool:
    """True for the version of a ranking split that ships."""
    return name in EVALUATED and name in known_splits(reaches) and load_split(reaches, name).digest == digest


def _with_strata(key: tuple[str, str], methods: dict[str, list[np.ndarray]]) -> pd.DataFrame:
    rates = pd.DataFrame({method: np.mean(seeds, axis=0) for method, seeds in methods.items()})
    return pd.concat([strata.strata(load_split(*key)), rates], axis=1)


def _heatmap(
    title: str,
    head: list[Html],
    columns: Sequence[Mapping[Hashable, float] | None],
    settings: Sequence[int],
    methods: Sequence[str],
    grouped: bool = False,
) -> Html:
    """A table of success [%] with a row for each method; the last row counts the settings of each column.

    `columns` hold the rate of each method, None for a column without settings. `grouped` draws an edge between rings.
    """
    edges = [_edge(number) if grouped else None for number in range(len(columns))]
    rows = []
    for method in methods:
        rates = (None if column is None else float(column[method]) for column in columns)
        rows.append(tag("tr", tag("th", method, scope="row"), *map(_cell, rates, edges)))
    counts = (tag("td", count, class_=edge) for count, edge in zip(settings, edges, strict=True))
    foot = tag("tfoot", tag("tr", tag("th", "settings", scope="row"), *counts))
    return tag("table", tag("caption", title), tag("thead", *head), tag("tbody", *rows), foot, class_="heat")


def _cell(rate: float | None, edge: str | None) -> Html:
    if rate is None:
        return tag("td", UNKNOWN, class_=edge)
    return tag("td", f"{100 * rate:.0f}", class_=edge, style=f"--rate:{100 * rate:.0f}%", data_value=f"{rate:.4f}")


def _edge(number: int) -> str | None:
    """The class of a ring's first column."""
    return "edge" if number % len(ANGLES) == 0 else None


def _corner(rows: int = 1) -> Html:
    return tag("th", "success %", scope="col", rowspan=rows)
