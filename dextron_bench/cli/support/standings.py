"""Rows of the leaderboard in print: scores, how episodes end, and tracks."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING

from dextron_bench.cli.support.output import print_json, print_table

if TYPE_CHECKING:
    import pandas as pd

    from dextron_bench.evaluation.results import Result
    from dextron_bench.scores.robustness import Robustness

INTERQUARTILE, REGRET, LAG = "interquartile mean [95 %]", "regret", "closing lag [s]"
OPTIONAL = (INTERQUARTILE, REGRET, "episodes", "seeds")  # On a narrow terminal.


def print_rows(rows: pd.DataFrame, as_json: bool = False) -> None:
    """Prints the leaderboard's rows, a table for each source of reaches and split, or JSON.

    A column "from" says where a row comes from, if the rows come from several places.
    """
    from dextron_bench.scores import cells

    if as_json:
        print_json(rows.to_dict("records"))
        return
    if rows.empty:
        print("no results yet; `dextron-bench run --method exp` makes some")
        return
    columns = ["method", "return [95 %]", "success % [95 %]", INTERQUARTILE, REGRET]
    for (reaches, split), group in rows.groupby(["reaches", "split"], sort=False):
        origin = ["from"] if "from" in group else []
        counts = ["seeds", "episodes", *(["failed"] if group["failed"].any() else []), *origin]
        lines = [
            [
                row["method"],
                cells.mean_return(row),
                cells.success(row),
                cells.interquartile_mean(row),
                cells.regret(row),
                *(row[name] for name in counts),
            ]
            for row in group.to_dict("records")
        ]
        title = f"{reaches} reaches, split {split}, version {group['version'].iloc[0]}"
        print_table(title, [*columns, *counts], lines, OPTIONAL)


def print_ranks(ranked: pd.DataFrame) -> None:
    """Prints the ranks of a leaderboard's latest round, a table for each source of reaches."""
    from dextron_bench.scores import cells
    from dextron_bench.splits.names import EVALUATED

    for reaches, rows in ranked.groupby("reaches"):
        splits = [name for name in EVALUATED if rows[name].notna().any()]
        lines = [
            [
                cells.rank(row) or row["unranked"],
                row["method"],
                cells.score(row),
                *(cells.share(row, name) for name in splits),
                row["seeds"],
            ]
            for row in rows.to_dict("records")
        ]
        title = (
            f"round {rows['round'].iloc[0]}: {reaches} reaches, success [%], margin {100 * rows['margin'].iloc[0]:.1f}"
        )
        print_table(title, ["rank", "method", "score [95 %]", *splits, "seeds"], lines)


def print_beside_published(results: list[Result], played: Collection[str], as_json: bool = False) -> bool:
    """Prints the rows of splits that were played, with the published rows beside them; True if an episode failed.

    JSON holds the new rows alone.
    """
    from dextron_bench.runs import result_files
    from dextron_bench.scores import standings

    rows = standings.table(results)
    rows = rows[rows["split"].isin(played)]
    if as_json:
        print_rows(rows, as_json=True)
    else:
        both = standings.table([*results, *result_files.published_beside(results)])
        both["from"] = both["method"].isin(rows["method"]).map({True: "this run", False: "published"})
        print_rows(both[both["split"].isin(played)])
    return bool(rows["failed"].any())


def print_endings(rows: pd.DataFrame) -> None:
    """Prints how the episodes of the leaderboard's rows end [%] (docs/diagnosis.md)."""
    from dextron_bench.evaluation.diagnosis import CAUSES
    from dextron_bench.scores import cells

    for (reaches, split), group in rows.groupby(["reaches", "split"], sort=False):
        lines = [[row["method"], *cells.cause_shares(row), cells.closing_lag(row)] for row in group.to_dict("records")]
        title = f"how episodes end [%]: {reaches} reaches, split {split}"
        print_table(title, ["method", *CAUSES, LAG], lines, ("agent failed", "never reached", LAG))


def print_robustness(results: Iterable[Result]) -> None:
    """Prints mean returns under tracks, and how much lower they are than without, if some were played."""
    from dextron_bench.scores import robustness
    from dextron_bench.splits.tracks import TRACKS

    rows = robustness.table(results)
    for reaches, split in dict.fromkeys((row.reaches, row.split) for row in rows):
        group = [row for row in rows if (row.reaches, row.split) == (reaches, split)]
        names = [name for name in TRACKS if any(name in row.returns for row in group)]
        lines = [
            [
                row.method,
                str(row.seeds),
                f"{row.plain:.2f}",
                *(_under_track(row, name) for name in names),
                "" if math.isnan(row.area) else f"{row.area:.3f}",
            ]
            for row in group
        ]
        title = f"tracks: {reaches} reaches, split {split}, mean return and loss [95 %]"
        print_table(title, ["method", "seeds", "plain", *names, "area"], lines)


def _under_track(row: Robustness, name: str) -> str:
    """A method's mean return under a track and what it loses there; empty if it did not play it."""
    if name not in row.returns:
        return ""
    loss = row.losses[name]
    return f"{row.returns[name]:.2f}, loses {loss.mean:.2f} [{loss.low:.2f}, {loss.high:.2f}]"
