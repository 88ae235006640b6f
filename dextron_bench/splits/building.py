"""Builds the splits from an expert database: holds out subjects and reaches, and measures how hard each row is."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.experts import branching, policies
from dextron_bench.reaches import reach, rotation, setting
from dextron_bench.splits.loading import EVALUATED, SPLIT_NAMES, split_digest
from dextron_bench.storage import atomic
from dextron_bench.world import task
from dextron_bench.world.engine import Engine

HARD_WINDOW = 0.08  # Largest window of a row of `hard`.
RULE = 0.065  # [m] distance from the bottle at which the rule of thumb closes (`reflex`).
RULE_SHARE = 0.5  # Largest share of the rows of `hard` that the rule of thumb solves.

# Two settings of one reach are near-equal if offsets in x and y, and duration noise, differ by less than these.
NEAR_OFFSET = 0.001  # [m]
NEAR_NOISE = 0.02
RANGE = policies.CRITICAL_DISTANCE[1] - policies.CRITICAL_DISTANCE[0]  # Width of the range of d_c.
SETTING = ["reach", "offset_x", "offset_y", "duration_noise"]
COLUMNS = ["split", *SETTING, "gain", "critical", "window"]


@dataclass(frozen=True)
class Sizes:
    """Numbers of rows, and the fraction of held-out reaches.

    `scan` is the number of points in a scan of d_c for the splits that rank methods, `coarse` for the other splits.
    """

    evaluated: int = 500
    val: int = 200
    open: int = 1000
    reaches: float = 0.2
    scan: int = 64
    coarse: int = 16


class TooFewRows(ValueError):
    """The database is too small for the splits."""


def partition(
    source: setting.Source, database: pd.DataFrame, seed: int, sizes: Sizes, rates: Mapping[str, float] | None
) -> dict[str, pd.DataFrame]:
    """The rows of every split except `hard` and `open`, from the solved rows of a database; raises TooFewRows.

    `rates` are the success rates of a search by subject; they decide which two subjects are held out, and None holds
    out none. Held-out reaches are drawn at random. `train` has one row per expert, without the settings that are
    near-equal to a setting of `val` or `test`; the other splits have one row per setting.
    """
    rng = np.random.default_rng([seed, 0, 1])  # Three words: the blocks of a search use two.
    solved = database[database["score"] == task.SUCCESS].sample(frac=1.0, random_state=rng)
    by_unseen_subjects, unseen_reaches = _draw_unseen(source, rng, sizes, rates)
    of_subject, of_reach = solved["reach"].isin(by_unseen_subjects), solved["reach"].isin(unseen_reaches)
    once = solved.drop_duplicates(SETTING)
    seen = once[~of_subject[once.index] & ~of_reach[once.index]]
    parts = {
        "val": _take(seen, 0, sizes.val, "val"),
        "test": _take(seen, sizes.val, sizes.evaluated, "test"),
        "unseen-reach": _take(once[of_reach[once.index]], 0, sizes.evaluated, "unseen-reach"),
    }
    if rates is not None:
        parts["unseen-subject"] = _take(once[of_subject[once.index]], 0, sizes.evaluated, "unseen-subject")
    held_out = pd.concat([parts["val"], parts["test"]])
    parts["train"] = without_near_equal(solved[~of_subject & ~of_reach], held_out).sort_index()
    return parts


def _draw_unseen(
    source: setting.Source, rng: np.random.Generator, sizes: Sizes, rates: Mapping[str, float] | None
) -> tuple[set[str], set[str]]:
    """The reaches of the held-out subjects, and the held-out reaches of the other subjects."""
    subject = {name: source.stratum(name).subject for name in source.names}
    unseen = set() if rates is None else unseen_subjects(rates, rng)
    others = [name for name in source.names if subject[name] not in unseen]
    unseen_reaches = set(rng.choice(others, round(len(others) * sizes.reaches), replace=False))
    return set(source.names) - set(others), unseen_reaches


def unseen_subjects(rates: Mapping[str, float], rng: np.random.Generator) -> set[str]:
    """Two subjects: one of the third that a search solves least often, and one of the middle third."""
    hardest, middle, _ = np.array_split(sorted(rates, key=rates.__getitem__), 3)
    return {str(rng.choice(hardest)), str(rng.choice(middle))}


def without_near_equal(rows: pd.DataFrame, held_out: pd.DataFrame) -> pd.DataFrame:
    """The rows whose setting is not near-equal to a setting of the held-out rows."""
    by_reach = {name: group[SETTING[1:]].to_numpy() for name, group in held_out.groupby("reach")}
    limits = np.array([NEAR_OFFSET, NEAR_OFFSET, NEAR_NOISE])

    def near(row: tuple) -> bool:
        others = by_reach.get(row[0])
        return others is not None and bool((np.abs(others - np.array(row[1:])) < limits).all(axis=1).any())

    keep = [not near(row) for row in rows[SETTING].itertuples(index=False, name=None)]
    return rows[keep]


def draw_open(source: setting.Source, parts: Iterable[pd.DataFrame], seed: int, sizes: Sizes) -> pd.DataFrame:
    """Uniform settings and gains, solvable or not, without d_c, near-equal to no setting of the other parts."""
    rng = np.random.default_rng([seed, 0, 2])
    count = 2 * sizes.open
    rows = setting.to_frame([source.sample(rng) for _ in range(count)]).assign(gain=rng.uniform(*policies.GAIN, count))
    return without_near_equal(rows, pd.concat(parts)).head(sizes.open)


def scan(source: setting.Source, rows: pd.DataFrame, engine: Engine, points: int) -> np.ndarray:
    """Sums of rewards (rows, points) of experts with each row's gain and the evenly spaced d_c of `grid`."""
    criticals = grid(points)
    paths = (source.path(case) for case in setting.from_frame(rows))
    batches = (branching.ExpertBatch(path, gain, criticals) for path, gain in zip(paths, rows["gain"], strict=True))
    scores = np.zeros((len(rows), points))
    for number, outcomes in branching.play(engine, batches):
        scores[number] = outcomes.returns
    return scores


def draw_hard(
    source: setting.Source, train: pd.DataFrame, engine: Engine, sizes: Sizes
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Splits `train` into the rows of `hard`, with their windows, and the rows that remain; raises TooFewRows.

    A row of `hard` has a window of at most HARD_WINDOW. An expert that closes at the distance RULE solves at most
    RULE_SHARE of them. Settings near-equal to one of `hard` leave `train`.
    """
    solved = train.groupby(SETTING, sort=False)["score"].transform("size")
    candidates = train[solved <= 2].drop_duplicates(SETTING)  # Three of a search's experts span more than HARD_WINDOW.
    windows = success_window(scan(source, candidates, engine, sizes.scan))
    narrow = candidates.assign(window=windows)[windows <= HARD_WINDOW]
    by_rule = solved_by_rule(source, narrow, engine)
    kept = narrow[~by_rule | (np.cumsum(by_rule) <= RULE_SHARE * sizes.evaluated)]
    hard = _take(kept, 0, sizes.evaluated, "hard")
    return hard, without_near_equal(train, hard)


def solved_by_rule(source: setting.Source, rows: pd.DataFrame, engine: Engine) -> np.ndarray:
    """True (rows,) where the expert with the row's gain succeeds if it closes at the distance RULE of the bottle."""
    paths = [source.path(case) for case in setting.from_frame(rows)]
    criticals = [np.array([RULE / first_distance(path)]) for path in paths]
    batches = map(branching.ExpertBatch, paths, rows["gain"], criticals)
    returns = {number: outcomes.returns[0] for number, outcomes in branching.play(engine, batches)}
    return np.array([returns[number] == task.SUCCESS for number in range(len(rows))], bool)


def first_distance(path: reach.Path) -> float:
    """Horizontal distance of the palm's centre from the bottle at the start of a path [m]."""
    centre = path.positions[0] + reach.PALM_AHEAD + rotation.rotate(path.quaternions[0], reach.PALM_CENTRE)
    return float(np.sqrt((centre[:2] ** 2).sum()))


def grid(points: int) -> np.ndarray:
    """The middles (points,) of equal bands of d_c."""
    return policies.CRITICAL_DISTANCE[0] + RANGE * (np.arange(points) + 0.5) / points


def success_window(scores: np.ndarray) -> np.ndarray:
    """Widths (rows,) of the range of d_c that succeeds, from a scan (rows, points)."""
    return RANGE * (scores == task.SUCCESS).mean(axis=1)


def best_critical(scores: np.ndarray) -> np.ndarray:
    """The best d_c (rows,) of a scan (rows, points): the middle of the longest run of points with the highest score."""
    return grid(scores.shape[1])[[_middle(row == row.max()) for row in scores]]


def build(
    source: setting.Source,
    database: pd.DataFrame,
    summary: Mapping[str, Any],
    folder: Path,
    engine: Engine,
    seed: int = 0,
    sizes: Sizes | None = None,
) -> dict[str, dict[str, Any]]:
    """Makes, scans and writes the splits of a source into `folder`; returns their entry in the catalogue.

    `database` holds the kept rows of a search, and `summary` its settings and statistics. The search is also the scan
    of `train`.
    """
    sizes = sizes or Sizes()
    rates = subject_rates(summary) if source.name == "real" else None
    parts = partition(source, database, seed, sizes, rates)
    tried = summary["search"]["experts"]
    parts["hard"], parts["train"] = draw_hard(source, parts["train"], engine, sizes)
    parts["open"] = draw_open(source, parts.values(), seed, sizes)
    tables = [
        parts[name].assign(split=name)[COLUMNS]
        if "window" in parts[name]
        else scan_split(source, name, parts[name], engine, sizes.scan if name in EVALUATED else sizes.coarse)
        for name in SPLIT_NAMES[1:]
        if name in parts
    ]
    solved = parts["train"].groupby(SETTING)["score"].transform("size").to_numpy()
    tables.insert(0, parts["train"].assign(window=RANGE * solved / tried, split="train")[COLUMNS])
    return write(source.name, pd.concat(tables, ignore_index=True), folder)


def subject_rates(summary: Mapping[str, Any]) -> dict[str, float]:
    """The success rate of a search for each subject, from the summary of its database."""
    return {row["value"]: row["solved_rate"] for row in summary["statistics"] if row["by"] == "subject"}


def write(reaches: str, table: pd.DataFrame, folder: Path) -> dict[str, dict[str, Any]]:
    """Writes the splits of a source, one after the other in `table`; returns their entry in the folder's catalogue."""
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
    """A split's rows with their windows of success; for `open` also with the best d_c of the scan."""
    once = rows.drop_duplicates(SETTING)
    scores = scan(source, once, engine, points)
    if name == "open":
        rows = rows.assign(critical=best_critical(scores))
    widths = once[SETTING].assign(window=success_window(scores))
    table = rows.merge(widths, on=SETTING, how="left").assign(split=name)
    return table[COLUMNS]


def _take(rows: pd.DataFrame, first: int, count: int, name: str) -> pd.DataFrame:
    part = rows.iloc[first : first + count]
    if len(part) < count:
        raise TooFewRows(
            f"split {name!r} needs {count} solved settings and the database has {len(part)}; continue the search"
        )
    return part


def _middle(flags: Sequence[bool]) -> int:
    """The index in the middle of the longest run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    runs = edges.reshape(-1, 2)
    start, stop = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return int((start + stop - 1) // 2)
