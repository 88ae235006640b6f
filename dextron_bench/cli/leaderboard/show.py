"""`dextron-bench leaderboard show`: the rows of runs, or of a leaderboard."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.standings import print_endings, print_ranks, print_robustness, print_rows
from dextron_bench.splits.tracks import PLUS


@dataclass(frozen=True)
class Show:
    """Print the leaderboard of the runs in a folder, and how their episodes end.

    Example: dextron-bench leaderboard show --board leaderboard
    """

    runs: flags.Runs = flags.RUNS
    board: Path | None = None
    """Show the rows of the leaderboard in this folder instead."""
    json: bool = False
    """Print the rows as JSON."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import collect, round_table
        from dextron_bench.runs import result_files
        from dextron_bench.scores import standings

        results = list(result_files.results(self.board / collect.RESULTS if self.board else self.runs))
        rows = standings.table(results)
        if self.json:
            print_rows(rows, as_json=True)
            return DONE
        if self.board:
            print_ranks(round_table.table(self.board))
        plain = rows[~rows["split"].str.contains(PLUS, regex=False)] if len(rows) else rows
        print_rows(plain)
        print_endings(plain)
        print_robustness(results)
        return DONE
