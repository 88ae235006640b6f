"""Two methods compared on the settings that both played (docs/statistics.md)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dextron_bench.runs.result_files import Side
from dextron_bench.scores import paired
from dextron_bench.splits import strata
from dextron_bench.world import task

ALL = "all"  # The group of all settings.


@dataclass(frozen=True, slots=True)
class Comparison:
    """What side B scores more than side A: `score` (of 20) and `success` (of 1), with `p_value` of McNemar's test.

    `flips` has a row for each setting of another outcome: `row`, `gained` (by B), the shares of seeds that solve it,
    `a` and `b`, and `subject`, `ring` and `angle` where the split ships. `groups` has one for ALL settings, for each
    subject and for each start region: `group`, `rows`, mean returns `a` and `b`, `difference`, `low`, `high`.
    """

    a: Side
    b: Side
    score: paired.Difference
    success: paired.Difference
    p_value: float
    flips: pd.DataFrame
    groups: pd.DataFrame


def compare(a: Side, b: Side) -> Comparison:
    """Compares two sides that `sides.pair` made; raises DamagedSplit."""
    rows = strata.shipped(a.reaches, a.split, a.digest)
    solved = [side.scores == task.SUCCESS for side in (a, b)]
    flips = paired.flips(*solved)
    return Comparison(
        a,
        b,
        paired.published(a.scores, b.scores),
        paired.published(*(each.astype(float) for each in solved)),
        flips.p_value,
        _flipped(flips, solved, rows),
        pd.DataFrame(_groups(a.scores, b.scores, rows)),
    )


def _flipped(flips: paired.Flips, solved: list[np.ndarray], rows: pd.DataFrame | None) -> pd.DataFrame:
    changed = np.sort(np.concatenate([flips.gained, flips.lost])).astype(int)
    a, b = (each.mean(axis=0)[changed] for each in solved)
    found = pd.DataFrame({"row": changed, "gained": np.isin(changed, flips.gained), "a": a, "b": b})
    return found if rows is None else found.join(rows.iloc[changed].reset_index(drop=True))


def _groups(a: np.ndarray, b: np.ndarray, rows: pd.DataFrame | None) -> Iterator[dict[str, str | int | float]]:
    groups = {ALL: np.arange(a.shape[1])}
    if rows is not None:
        groups |= {f"subject {name}": own for name, own in sorted(rows.groupby("subject").indices.items())}
        regions = "ring " + rows["ring"].astype(str) + ", angle " + rows["angle"].astype(str)
        groups |= {str(name): own for name, own in sorted(rows.groupby(regions).indices.items())}
    for name, own in groups.items():
        found = paired.published(a[:, own], b[:, own])
        means = {"a": float(a[:, own].mean()), "b": float(b[:, own].mean())}
        interval = {"difference": found.mean, "low": found.low, "high": found.high}
        yield {"group": name, "rows": len(own), **means, **interval}
