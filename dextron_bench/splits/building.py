"""How the splits are made from an expert database: what is held out, and how hard each row is."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.experts import branching, policies
from dextron_bench.reaches import setting
from dextron_bench.splits.loading import SPLIT_NAMES, split_digest
from dextron_bench.storage import atomic
from dextron_bench.world import task
from dextron_bench.world.engine import Engine

NEAR_OFFSET = 0.001  # [m] settings of one reach whose offsets differ by less than this in x and y
NEAR_NOISE = 0.02  # and whose duration noise differs by less than this are near-equal.
RANGE = policies.CRITICAL_DISTANCE[1] - policies.CRITICAL_DISTANCE[0]  # Width of the range of d_c.
SETTING = ["reach", "offset_x", "offset_y", "duration_noise"]
COLUMNS = ["split", *SETTING, "gain", "critical", "window"]


@dataclass(frozen=True)
class Sizes:
    """Rows of the splits, what is held out, and how finely d_c is scanned."""

    evaluated: int = 500
    val: int = 200
    open: int = 1000
    subjects: int = 2
    reaches: float = 0.2
    scan: int = 16


class TooFewRows(ValueError):
    """A database too small for the splits."""


def partition(
    source: setting.Source, database: pd.DataFrame, seed: int, sizes: Sizes, by_subject: bool
) -> dict[str, pd.DataFrame]:
    """Rows of every split but `open` from the solved rows of a database; raises TooFewRows.

    Held-out subjects and reaches are drawn at random. Evaluated splits have one row a setting; `train`
    keeps every expert of its settings, less settings near-equal to an evaluated one.
    """
    rng = np.random.default_rng([seed, 0, 1])  # Three words, where the blocks of a search have two.
    solved = database[database["score"] == task.SUCCESS].sample(frac=1.0, random_state=rng)
    subject = {name: source.stratum(name).subject for name in source.names}
    subjects = sorted(set(subject.values()))
    away = set(rng.choice(subjects, sizes.subjects, replace=False)) if by_subject else set()
    home = [name for name in source.names if subject[name] not in away]
    unseen = set(rng.choice(home, round(len(home) * sizes.reaches), replace=False))
    is_away, is_unseen = solved["reach"].map(subject).isin(away), solved["reach"].isin(unseen)
    once = solved.drop_duplicates(SETTING)
    seen = once[~is_away[once.index] & ~is_unseen[once.index]]
    parts = {
        "val": _take(seen, 0, sizes.val, "val"),
        "test": _take(seen, sizes.val, sizes.evaluated, "test"),
        "unseen-reach": _take(once[is_unseen[once.index]], 0, sizes.evaluated, "unseen-reach"),
    }
    if by_subject:
        parts["unseen-subject"] = _take(once[is_away[once.index]], 0, sizes.evaluated, "unseen-subject")
    held = pd.concat([parts["val"], parts["test"]])
    parts["train"] = without_near_equal(solved[~is_away & ~is_unseen], held).sort_index()
    return parts


def without_near_equal(rows: pd.DataFrame, held: pd.DataFrame) -> pd.DataFrame:
    """The rows whose setting is not near-equal to one of the held-out rows."""
    by_reach = {name: group[SETTING[1:]].to_numpy() for name, group in held.groupby("reach")}
    limits = np.array([NEAR_OFFSET, NEAR_OFFSET, NEAR_NOISE])

    def near(row: tuple) -> bool:
        others = by_reach.get(row[0])
        return others is not None and bool((np.abs(others - np.array(row[1:])) < limits).all(axis=1).any())

    keep = [not near(row) for row in rows[SETTING].itertuples(index=False, name=None)]
    return rows[keep]


def draw_open(source: setting.Source, parts: Iterable[pd.DataFrame], seed: int, sizes: Sizes) -> pd.DataFrame:
    """Uniform settings and gains, solvable or not, near-equal to none of the other parts, with no d_c yet."""
    rng = np.random.default_rng([seed, 0, 2])
    count = 2 * sizes.open
    rows = setting.to_frame([source.sample(rng) for _ in range(count)]).assign(gain=rng.uniform(*policies.GAIN, count))
    return without_near_equal(rows, pd.concat(parts)).head(sizes.open)


def scan(source: setting.Source, rows: pd.DataFrame, engine: Engine, points: int) -> np.ndarray:
    """Sums of rewards (rows, points) of experts with each row's gain and evenly spaced d_c (see `grid`)."""
    criticals = grid(points)
    paths = (source.path(case) for case in setting.from_frame(rows))
    asked = (branching.ExpertBatch(p, gain, criticals) for p, gain in zip(paths, rows["gain"], strict=True))
    scores = np.zeros((len(rows), points))
    for number, found in branching.play(engine, asked):
        scores[number] = found.returns
    return scores


def grid(points: int) -> np.ndarray:
    """The middles of equal bands of d_c."""
    return policies.CRITICAL_DISTANCE[0] + RANGE * (np.arange(points) + 0.5) / points


def success_window(scores: np.ndarray) -> np.ndarray:
    """Width of the range of d_c that succeeds, from a scan (rows, points); shape (rows,)."""
    return RANGE * (scores == task.SUCCESS).mean(axis=1)


def best_critical(scores: np.ndarray) -> np.ndarray:
    """The d_c of highest sum of rewards in a scan (rows, points), in the middle of its longest run; shape (rows,)."""
    return grid(scores.shape[1])[[_middle(row == row.max()) for row in scores]]


def build(
    source: setting.Source,
    database: pd.DataFrame,
    tried: int,
    folder: Path,
    engine: Engine,
    seed: int = 0,
    sizes: Sizes | None = None,
) -> dict[str, dict[str, Any]]:
    """Makes, scans and writes the splits of a source into `folder`; returns their entry in the catalogue.

    `database` holds the kept rows of a search that tried so many experts a setting: for `train`, the search
    itself is the scan.
    """
    sizes = sizes or Sizes()
    parts = partition(source, database, seed, sizes, by_subject=source.name == "real")
    parts["open"] = draw_open(source, parts.values(), seed, sizes)
    tables = [scan_split(source, name, parts[name], engine, sizes.scan) for name in SPLIT_NAMES[1:] if name in parts]
    solved = parts["train"].groupby(SETTING)["score"].transform("size").to_numpy()
    tables.insert(0, parts["train"].assign(window=RANGE * solved / tried, split="train")[COLUMNS])
    return write(source.name, pd.concat(tables, ignore_index=True), folder)


def write(reaches: str, table: pd.DataFrame, folder: Path) -> dict[str, dict[str, Any]]:
    """Writes a source's splits, one after another in `table`, into `folder`; returns their entry in its catalogue."""
    atomic.write_atomically(folder / f"splits-{reaches}.parquet", lambda part: table.to_parquet(part))
    entry = {
        str(name): {"rows": len(rows), "digest": split_digest(rows)}
        for name, rows in table.groupby("split", sort=False)
    }
    catalogue = folder / "splits.json"
    others = json.loads(catalogue.read_text(encoding="utf-8")) if catalogue.exists() else {}
    atomic.write_json(catalogue, others | {reaches: entry})
    return entry


def scan_split(source: setting.Source, name: str, rows: pd.DataFrame, engine: Engine, points: int) -> pd.DataFrame:
    """A split's rows with their windows, and for `open` with the best d_c of the scan."""
    once = rows.drop_duplicates(SETTING)
    scores = scan(source, once, engine, points)
    if name == "open":
        rows = rows.assign(critical=best_critical(scores))
    widths = once[SETTING].assign(window=success_window(scores))
    table = rows.merge(widths, on=SETTING, how="left").assign(split=name)
    return table[COLUMNS]


def _take(rows: pd.DataFrame, first: int, count: int, name: str) -> pd.DataFrame:
    taken = rows.iloc[first : first + count]
    if len(taken) < count:
        raise TooFewRows(f"split {name!r} needs {count} solved settings and the database has {len(taken)}; search on")
    return taken


def _middle(flags: Sequence[bool]) -> int:
    """Index in the middle of the longest run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    runs = edges.reshape(-1, 2)
    start, stop = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return int((start + stop - 1) // 2)
