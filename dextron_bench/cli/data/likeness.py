"""`dextron-bench data likeness`: tests how like recorded reaches the synthetic ones are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table, progress_bar

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Likeness:
    """Train classifiers to separate synthetic from recorded reaches and print their AUC; 0.5 is chance. Takes minutes.

    Example: dextron-bench data likeness --json
    """

    seed: int = 0
    """Seed of folds, fits, forests and intervals."""
    json: bool = False
    """Print JSON: lists of rows by table, with all start regions and classifiers."""
    quiet: flags.Quiet = False

    def __call__(self) -> int:
        from dextron_bench.reaches.recorded import cache
        from dextron_bench.reaches.synthetic import two_sample

        with progress_bar("models and classifiers", self.quiet) as progress:
            tables = two_sample.study(cache.load_reaches(), self.seed, progress)
        if self.json:
            print_json({name: table.to_dict("records") for name, table in tables.items()})
        else:
            print_likeness(tables)
        return DONE


def print_likeness(tables: dict[str, pd.DataFrame]) -> None:
    """Prints the tables of `two_sample.study`."""
    held_out, strangers = with_interval(tables["held out"]), with_interval(tables["strangers"])
    total = held_out[held_out["stratum"] == "all"]
    print_pivot("AUC [95 %] on held-out reaches", total, "group", "classifier")
    for group, rows in held_out[held_out["classifier"] == "forest"].groupby("group", sort=False):
        print_regions(f"AUC ± half of 95 % interval, forest, {group}", rows)
    for classifier, rows in strangers.groupby("classifier", sort=False):
        print_pivot(f"AUC for strangers, mean and range of splits, {classifier}", rows, "group", "beside")
    print_rows("lowest and highest AUC of a single feature", tables["alone"])
    distances = tables["nearest"].set_index("source") * 1000.0
    print_rows("mm to the nearest other recording, quantiles", distances.reset_index())
    names = tables["distributions"]["measure"].str.replace("[", "in ").str.rstrip("]")
    print_rows("quantiles", tables["distributions"].assign(measure=names))


def with_interval(table: pd.DataFrame) -> pd.DataFrame:
    """A table of AUCs with a column `cell`: the AUC and its interval as text."""
    cells = [f"{row.auc:.2f} [{row.low:.2f}, {row.high:.2f}]" for row in table.itertuples()]
    return table.assign(cell=cells)


def print_regions(title: str, table: pd.DataFrame) -> None:
    """Prints the AUCs of one group and classifier: a row for each ring, a column for each angle, and the totals."""
    texts = {
        row["stratum"]: f"{row['auc']:.2f} ±{(row['high'] - row['low']) / 2:.2f}" for row in table.to_dict("records")
    }
    rings, angles = ([name for name in texts if name.startswith(kind)] for kind in ("ring", "angle"))
    rows = [[ring, *(texts.get(f"{ring[-1]}-{angle[-1]}", "") for angle in angles), texts[ring]] for ring in rings]
    print_table(title, ["", *angles, "all"], [*rows, ["all", *(texts[angle] for angle in angles), texts["all"]]])


def print_pivot(title: str, table: pd.DataFrame, rows: str, columns: str) -> None:
    """Prints the column `cell` of a table as a grid: the values of `rows` down, the values of `columns` across."""
    wide = table.set_index([rows, columns])["cell"].unstack(sort=False)
    print_table(title, [rows, *wide.columns], wide.reset_index().to_numpy().tolist())


def print_rows(title: str, table: pd.DataFrame) -> None:
    """Prints a table with all its columns."""
    print_table(title, [str(column) for column in table.columns], table.itertuples(index=False))
