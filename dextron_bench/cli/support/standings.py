"""`dextron-bench leaderboard show, build, serve`: the rows of runs, the published leaderboard, and its page."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table
from dextron_bench.cli.support.serving import serve
from dextron_bench.splits.tracks import PLUS

if TYPE_CHECKING:
    import pandas as pd

    from dextron_bench.scores.robustness import Robustness

FRESH = ("fresh [95 %]", "gap [95 %]", "mark")  # Columns of a table in which some row has played fresh settings.
INTERQUARTILE, REGRET, LAG = "interquartile mean [95 %]", "regret", "closing lag [s]"
OPTIONAL = (INTERQUARTILE, "gap [95 %]", "fresh [95 %]", REGRET, "episodes", "seeds")  # On a narrow terminal.


@dataclass(frozen=True)
class Show:
    """Print the leaderboard of the runs in a folder, and how their episodes end.

    Example: dextron-bench leaderboard show --runs leaderboard/results
    """

    runs: Path = Path("runs")
    """Folder of all runs."""
    json: bool = False
    """Print the rows as JSON."""

    def __call__(self) -> int:
        from dextron_bench.runs import result_files
        from dextron_bench.scores import standings

        results = list(result_files.results(self.runs))
        rows = standings.table(results)
        if self.json:
            print_rows(rows, as_json=True)
            return DONE
        plain = rows[~rows["split"].str.contains(PLUS, regex=False)] if len(rows) else rows
        print_rows(plain)
        print_endings(plain)
        print_robustness(results)
        return DONE


@dataclass(frozen=True)
class Build:
    """Build the tables, pictures and page of the published leaderboard from its results.

    Example: dextron-bench leaderboard build --runs runs --into leaderboard
    """

    runs: Path | None = None
    """A folder of finished runs to publish first: their results, learning curves and weights."""
    into: Path = Path("leaderboard")
    """Folder of the leaderboard."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import build, collect

        if self.runs is not None:
            print(*collect.take(self.runs, self.into), sep="\n")
        print(*build.build(self.into), sep="\n")
        return DONE


@dataclass(frozen=True)
class Serve:
    """Serve the leaderboard's page on this machine only, with recordings in Rerun's web viewer. Ctrl-C stops it.

    Example: dextron-bench leaderboard serve --port 8000
    """

    port: int = 8765
    """The port on 127.0.0.1; 0 takes a free one."""
    into: Path = Path("leaderboard")
    """Folder of the leaderboard; its recordings are in the folder recordings next to it."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import server as leaderboard_server
        from dextron_bench.recording import ViewerError, web_viewer_files

        with leaderboard_server.Server(leaderboard_server.Site(self.into), self.port) as server:
            try:
                server.site.viewer.update(web_viewer_files())
            except ViewerError as error:
                print(f"dextron-bench: links download recordings, without a viewer: {error}", file=sys.stderr)
            serve(server)
        return DONE


def print_rows(rows: pd.DataFrame, as_json: bool = False) -> None:
    """Prints the leaderboard's rows, a table for each source of reaches and split, or JSON.

    A column "from" says where a row comes from, if the rows come from several places.
    """
    from dextron_bench.scores import cells

    if as_json:
        print_json([{name: none_for_nan(value) for name, value in row.items()} for row in rows.to_dict("records")])
        return
    if rows.empty:
        print("no results yet; `dextron-bench run --method exp` makes some")
        return
    columns = ["rank", "method", "return [95 %]", "success % [95 %]", INTERQUARTILE, REGRET]
    for (reaches, split), group in rows.groupby(["reaches", "split"], sort=False):
        origin = ["from"] if "from" in group else []
        counts = ["seeds", "episodes", *(["failed"] if group["failed"].any() else []), *origin]
        is_fresh = "fresh" in group and bool(group["fresh"].notna().any())
        lines = [
            [
                *(cells.rank(row), row["method"], cells.mean_return(row), cells.success(row)),
                *(cells.interquartile_mean(row), cells.regret(row)),
                *([cells.fresh(row), cells.gap(row), cells.mark(row)] if is_fresh else []),
                *(row[name] for name in counts),
            ]
            for row in group.to_dict("records")
        ]
        title = f"{reaches} reaches, split {split}, version {group['version'].iloc[0]}"
        print_table(title, [*columns, *(FRESH if is_fresh else ()), *counts], lines, OPTIONAL)


def print_beside_published(results: list[dict[str, Any]], played: Collection[str], as_json: bool = False) -> bool:
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
        both = standings.table([*results, *result_files.published_beside(results)]).drop(columns="fresh")
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


def print_robustness(results: Iterable[dict[str, Any]]) -> None:
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


def none_for_nan(value: Any) -> Any:
    """None for NaN, which JSON does not have; any other value unchanged."""
    return None if value != value else value
