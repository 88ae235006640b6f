"""`dextron-bench recordings choose`: selects a few recordings of the runs to show."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_table
from dextron_bench.reaches.sources import SourceName


@dataclass(frozen=True)
class Choose:
    """Copy a few recordings of the runs into a folder; record the episodes that are not recorded yet.

    These are the shortest success and the shortest failure of every method, or of the methods that --method names,
    and the clearest episode of each of the five kinds that explain the success model, by any method.

    Example: dextron-bench recordings choose --reaches real --into recordings
    """

    into: Path = Path("recordings")
    """The folder for the recordings."""
    reaches: tuple[SourceName, ...] = ("synthetic", "minjerk")
    """Sources of reaches, in order; each method is shown on the first one that it played."""
    method: tuple[str, ...] = ()
    """Methods whose successes and failures are shown, by their names on the leaderboard; by default all."""
    split: str = "test"
    """The split of the episodes."""
    rows: int = 100
    """How many rows of the split to choose from, from the first."""
    runs: flags.Runs = flags.RUNS

    def __call__(self) -> int:
        from dextron_bench.leaderboard import highlights

        chosen = highlights.choose(self.runs, self.reaches, self.split, self.rows, self.method)
        files = highlights.make(chosen, self.into)
        columns = ["method", "row", "return", "steps", "cause"]
        cells = [
            [file.name, *row, round(file.stat().st_size / 1000)]
            for file, row in zip(files, chosen[columns].itertuples(index=False), strict=True)
        ]
        print_table(f"recordings in {self.into}", ["file", *columns, "kB"], cells)
        return DONE
