"""`dextron-bench leaderboard`: the table, computed from episodes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dextron_bench.verbs.printing import print_json, print_table

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Leaderboard:
    """Print the leaderboard of the runs in a folder, computed from their episodes' scores.

    Example: dextron-bench leaderboard --runs runs
    """

    runs: Path = Path("runs")
    """Folder of all runs."""
    json: bool = False
    """Print the rows as JSON."""

    def __call__(self) -> int:
        from dextron_bench import leaderboard, records

        print_rows(leaderboard.table(records.results(self.runs)), self.json)
        return 0


def print_rows(rows: pd.DataFrame, as_json: bool) -> None:
    """The leaderboard's rows on stdout."""
    if as_json:
        print_json(rows.to_dict("records"))
        return
    if rows.empty:
        print("no results yet; `dextron-bench run --method exp` makes some")
        return
    for (reaches, split), group in rows.groupby(["reaches", "split"], sort=False):
        failed = bool(group["failed"].any())
        cells = [
            [
                row["method"],
                f"{row['return']:.2f} [{row['return_low']:.2f}, {row['return_high']:.2f}]",
                f"{100 * row['success']:.1f} [{100 * row['success_low']:.1f}, {100 * row['success_high']:.1f}]",
                row["seeds"],
                row["episodes"],
                *([row["failed"]] if failed else []),
            ]
            for row in group.to_dict("records")
        ]
        columns = ["method", "return [95 %]", "success % [95 %]", "seeds", "episodes", *(["failed"] if failed else [])]
        print_table(f"{reaches} reaches, split {split}, version {group['version'].iloc[0]}", columns, cells)
