"""`dextron-bench leaderboard`: the rows of all runs in a folder, the published ones, and their page."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dextron_bench.cli.output import print_json, print_table

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Show:
    """Print the leaderboard of the runs in a folder, computed from their episodes' scores, and how episodes end.

    Example: dextron-bench leaderboard show --runs leaderboard/results
    """

    runs: Path = Path("runs")
    """Folder of all runs."""
    json: bool = False
    """Print the rows as JSON."""

    def __call__(self) -> int:
        from dextron_bench.runs import result_files
        from dextron_bench.scores import standings

        rows = standings.table(result_files.results(self.runs))
        print_rows(rows, self.json)
        if not self.json:
            print_endings(rows)
        return 0


@dataclass(frozen=True)
class Build:
    """Make the published leaderboard's tables, pictures and page from its results, after finished runs' are added.

    Example: dextron-bench leaderboard build --runs runs --into leaderboard
    """

    runs: Path | None = None
    """Folder of runs whose results, learning curves and weights are published; by default none is added."""
    into: Path = Path("leaderboard")
    """Folder of the leaderboard."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import build, collect

        if self.runs is not None:
            print(*collect.take(self.runs, self.into), sep="\n")
        print(*build.build(self.into), sep="\n")
        return 0


@dataclass(frozen=True)
class Serve:
    """Serve the leaderboard's page to this machine alone, recordings opened in Rerun's web viewer; Ctrl-C ends it.

    Example: dextron-bench leaderboard serve --port 8000
    """

    port: int = 8765
    """Where to listen on 127.0.0.1; 0 takes a free port."""
    into: Path = Path("leaderboard")
    """Folder of the leaderboard, beside that of its recordings."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import server as leaderboard_server
        from dextron_bench.recording import ViewerError, web_viewer_files

        with leaderboard_server.Server(leaderboard_server.Site(self.into), self.port) as server:
            try:
                server.site.viewer.update(web_viewer_files())
            except ViewerError as error:
                print(f"dextron-bench: recordings will be downloaded, not opened: {error}", file=sys.stderr)
            print(server.address, flush=True)
            server.serve_forever()
        return 0


def print_rows(rows: pd.DataFrame, as_json: bool) -> None:
    """The leaderboard's rows on stdout."""
    if as_json:
        print_json([{name: none_for_nan(value) for name, value in row.items()} for row in rows.to_dict("records")])
        return
    if rows.empty:
        print("no results yet; `dextron-bench run --method exp` makes some")
        return
    for (reaches, split), group in rows.groupby(["reaches", "split"], sort=False):
        failed = bool(group["failed"].any())
        cells = [
            [
                "" if isnan(row["rank"]) else f"{row['rank']:.0f}",
                row["method"],
                _interval(row, "return", 2),
                _interval(row, "success", 1, 100.0),
                "" if isnan(row["iqm"]) else _interval(row, "iqm", 2),
                "" if isnan(row["regret"]) else f"{row['regret']:.2f}",
                row["seeds"],
                row["episodes"],
                *([row["failed"]] if failed else []),
            ]
            for row in group.to_dict("records")
        ]
        columns = [
            "rank",
            "method",
            "return [95 %]",
            "success % [95 %]",
            "interquartile mean [95 %]",
            "regret",
            "seeds",
        ]
        columns += ["episodes", *(["failed"] if failed else [])]
        print_table(f"{reaches} reaches, split {split}, version {group['version'].iloc[0]}", columns, cells)


def _interval(row: Mapping[Any, Any], name: str, digits: int, unit: float = 1.0) -> str:
    mean, low, high = (f"{unit * row[column]:.{digits}f}" for column in (name, f"{name}_low", f"{name}_high"))
    return f"{mean} [{low}, {high}]"


def print_endings(rows: pd.DataFrame) -> None:
    """How the episodes of the leaderboard's rows end [%], on stdout (docs/diagnosis.md)."""
    from dextron_bench.evaluation.diagnosis import CAUSES

    for (reaches, split), group in rows.groupby(["reaches", "split"], sort=False):
        cells = [
            [
                row["method"],
                *(f"{100 * row[cause] / row['episodes']:.1f}" for cause in CAUSES),
                "" if row["closing_lag"] != row["closing_lag"] else f"{row['closing_lag']:.2f}",
            ]
            for row in group.to_dict("records")
        ]
        title = f"how episodes end [%]: {reaches} reaches, split {split}"
        print_table(title, ["method", *CAUSES, "closing lag [s]"], cells)


def none_for_nan(value: Any) -> Any:
    """A value that JSON has, where it has no NaN."""
    return None if value != value else value
