"""`dextron-bench data mc`: searches for experts by Monte Carlo sampling."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.support import flags, pieces
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table, progress_bar

if TYPE_CHECKING:
    from dextron_bench.experts import montecarlo


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
    pieces: Annotated[pieces.Pieces, tyro.conf.arg(name="")] = field(default_factory=pieces.Pieces)
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
        from dextron_bench.experts import database, montecarlo
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.world.engine import Engine

        share = self.pieces.parsed()
        search = montecarlo.Search(self.reaches, self.seed)
        folder = self.runs / "mc" / self.reaches / f"seed{self.seed}"
        source = open_source(self.reaches)
        engine = Engine(montecarlo.SLOTS, self.threads)
        if self.extend:
            rows, summary = database.load_shipped(self.reaches)
            database.check_physics(summary)
            montecarlo.restore(source, search, folder, rows, summary["settings"] // search.block)
        if share is not None:
            with progress_bar(f"blocks of share {share}", self.quiet) as progress:
                count = montecarlo.run_share(source, search, folder, self.rows, engine, share, progress)
            return pieces.print_done(share, f"{count} blocks", folder)
        if self.pieces.merge:
            montecarlo.check_complete(search, folder, self.rows)
        if self.pieces.cluster:
            self._play_on_cluster(search, folder)
        with progress_bar("rows of return 20", self.quiet) as progress:
            draws = montecarlo.run(source, search, folder, self.rows, engine, progress)
        file, summary = database.save(draws, source, search, folder, f"experts-{self.reaches}")
        print_json(summary) if self.json else self._print(summary, file)
        return DONE

    def _play_on_cluster(self, search: montecarlo.Search, folder: Path) -> None:
        from dextron_bench.cluster import searches

        with (
            pieces.connected(self.pieces.cluster, self.runs, self.threads) as cluster,
            progress_bar("rows of return 20", self.quiet) as progress,
        ):
            searches.play_blocks(cluster, search, folder, self.runs, self.rows, progress)

    def _print(self, summary: dict[str, Any], file: Path) -> None:
        columns = ["by", "value", "draws", "kept", "solved", "kept [%]", "solved [%]"]
        rows = [
            [*list(row.values())[:5], 100 * row["kept_rate"], 100 * row["solved_rate"]] for row in summary["statistics"]
        ]
        print_table(f"{self.reaches}: {summary['kept']} of {summary['draws']} draws kept", columns, rows)
        print(f"{summary['kept']} rows ({summary['solved']} of return 20) of {summary['draws']} draws: {file}")
