"""`dextron-bench data mc`: searches for experts by Monte Carlo sampling."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table, progress_bar
from dextron_bench.cli.support.pieces import PieceFlags, Pieces


@dataclass(frozen=True)
class MonteCarlo:
    """Draw settings and experts at random and keep the pairs that grasp: build or extend an expert database.

    If the search is interrupted, the same command continues it and gives the same rows.

    Example: dextron-bench data mc --reaches real --rows 10000 --seed 0
    """

    reaches: flags.Reaches = "synthetic"
    rows: int = 1000
    """Search until this many rows have the full return of 20."""
    seed: int = 0
    """Seed of all draws."""
    pieces: Pieces = field(default_factory=PieceFlags)
    threads: int = 0
    """Threads of the simulation; 0 means one per processor. On a cluster: of a piece, and 0 means one."""
    extend: bool = False
    """Start from the shipped database of this source of reaches, not from an empty one."""
    runs: Path = Path("runs")
    """Folder of all runs; also holds the files of the search."""
    quiet: flags.Quiet = False
    json: bool = False
    """Print the summary as JSON."""

    def __call__(self) -> int:
        from dextron_bench.experts import database, montecarlo, search_work
        from dextron_bench.storage.pieces import Place

        self.pieces.check()
        search = montecarlo.Search(self.reaches, self.seed)
        folder = self.runs / "mc" / self.reaches / f"seed{self.seed}"
        work = search_work.open_work(Place(self.runs, folder, self.threads), search, self.rows)
        if self.extend:
            rows, summary = database.load_shipped(self.reaches)
            database.check_physics(summary)
            work.restore(rows, summary["settings"] // search.block)
        if self.pieces.play_blocks(work, self.runs, self.threads, self.quiet):
            return DONE
        with progress_bar("rows of return 20", self.quiet) as progress:
            draws = work.run(progress)
        file, summary = database.save(draws, work.source, search, folder, f"experts-{self.reaches}")
        print_json(summary) if self.json else self._print(summary, file)
        return DONE

    def _print(self, summary: dict[str, Any], file: Path) -> None:
        columns = ["by", "value", "draws", "kept", "solved", "kept [%]", "solved [%]"]
        rows = [
            [*list(row.values())[:5], 100 * row["kept_rate"], 100 * row["solved_rate"]] for row in summary["statistics"]
        ]
        print_table(f"{self.reaches}: {summary['kept']} of {summary['draws']} draws kept", columns, rows)
        print(f"{summary['kept']} rows ({summary['solved']} of return 20) of {summary['draws']} draws: {file}")
