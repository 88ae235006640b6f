"""Builds the splits from an expert database: holds out subjects and reaches, and measures how hard each row is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.experts import policies
from dextron_bench.experts.database import Summary
from dextron_bench.reaches import setting
from dextron_bench.splits import hard
from dextron_bench.splits.loading import Catalogue, SplitEntry, entries
from dextron_bench.splits.names import EVALUATED, SPLIT_NAMES
from dextron_bench.splits.near_equal import SETTING, without_near_equal
from dextron_bench.splits.scanning import RANGE, Scanner, best_critical, success_window
from dextron_bench.storage import atomic, records
from dextron_bench.world import task

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


def partition(
    source: setting.Source, database: pd.DataFrame, seed: int, sizes: Sizes, rates: Mapping[str, float] | None
) -> dict[str, pd.DataFrame]:
    """The rows of every split except `hard` and `open`, from the solved rows of a database; raises BadInput.

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


def draw_open(source: setting.Source, parts: Iterable[pd.DataFrame], seed: int, sizes: Sizes) -> pd.DataFrame:
    """Uniform settings and gains, solvable or not, without d_c, near-equal to no setting of the other parts."""
    rng = np.random.default_rng([seed, 0, 2])
    count = 2 * sizes.open
    rows = setting.to_frame([source.sample(rng) for _ in range(count)]).assign(gain=rng.uniform(*policies.GAIN, count))
    return without_near_equal(rows, pd.concat(parts)).head(sizes.open)


def build(
    scanner: Scanner,
    database: pd.DataFrame,
    summary: Summary,
    folder: Path,
    seed: int = 0,
    sizes: Sizes | None = None,
) -> tuple[dict[str, SplitEntry], float]:
    """Makes, scans and writes the splits of a source into `folder`.

    `database` holds the kept rows of a search, and `summary` its settings and statistics. The search is also the scan
    of `train`. Returns the entry in the catalogue, and the distance [m] of the rule of thumb that is best on `val`.
    """
    source, sizes = scanner.source, sizes or Sizes()
    rates = subject_rates(summary) if source.name == "real" else None
    parts = partition(source, database, seed, sizes, rates)
    tried = summary.search.experts
    distance = hard.best_distance(scanner, parts["val"])
    held_out = pd.concat([part for name, part in parts.items() if name != "train"])
    settings = hard.HardSettings(scanner, parts["train"], held_out, distance, sizes.coarse, sizes.scan)
    parts["hard"] = settings.draw(sizes.evaluated, seed)
    parts["open"] = draw_open(source, parts.values(), seed, sizes)
    solved = parts["train"].groupby(SETTING)["score"].transform("size").to_numpy()
    windows = RANGE * solved / tried
    tables = [parts["train"].assign(window=windows, split="train")[COLUMNS]]
    for name in [name for name in SPLIT_NAMES[1:] if name in parts]:
        points = sizes.scan if name in EVALUATED else sizes.coarse
        known = "window" in parts[name]
        tables.append(
            parts[name].assign(split=name)[COLUMNS] if known else scan_split(scanner, name, parts[name], points)
        )
    return write(source.name, pd.concat(tables, ignore_index=True), folder), distance


def subject_rates(summary: Summary) -> dict[str, float]:
    """The success rate of a search for each subject, from the summary of its database."""
    return {row.value: row.solved_rate for row in summary.statistics if row.by == "subject"}


def write(reaches: str, table: pd.DataFrame, folder: Path) -> dict[str, SplitEntry]:
    """Writes the splits of a source, one after the other in `table`; returns their entry in the folder's catalogue."""
    atomic.write_atomically(folder / f"splits-{reaches}.parquet", lambda part: table.to_parquet(part))
    entry = entries(table)
    catalogue = folder / "splits.json"
    others = records.read(catalogue, Catalogue) if catalogue.exists() else {}
    atomic.write_json(catalogue, others | {reaches: entry})
    return entry


def scan_split(scanner: Scanner, name: str, rows: pd.DataFrame, points: int) -> pd.DataFrame:
    """A split's rows with their windows of success; for `open` also with the best d_c of the scan."""
    once = rows.drop_duplicates(SETTING)
    scores = scanner.scan(once, points)
    if name == "open":
        rows = rows.assign(critical=best_critical(scores))
    widths = once[SETTING].assign(window=success_window(scores))
    table = rows.merge(widths, on=SETTING, how="left").assign(split=name)
    return table[COLUMNS]


def _take(rows: pd.DataFrame, first: int, count: int, name: str) -> pd.DataFrame:
    part = rows.iloc[first : first + count]
    if len(part) < count:
        raise BadInput(
            f"split {name!r} needs {count} solved settings and the database has {len(part)}; continue the search"
        )
    return part
