"""`dextron-bench recordings choose`: a small choice of recordings that shows what there is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dextron_bench.cli.output import print_table


@dataclass(frozen=True)
class Choose:
    """Put a small choice of the runs' recordings into a folder, made where they are missing.

    Of every method a success and a failure, the shortest; and of the five kinds of episodes that explain the success
    model the clearest each.

    Example: dextron-bench recordings choose --reaches real --into recordings
    """

    into: Path = Path("recordings")
    """Where the recordings go."""
    reaches: tuple[Literal["real", "synthetic", "minjerk"], ...] = ("synthetic", "minjerk")
    """Sources of reaches; a method is shown on the first of them that it played."""
    split: str = "test"
    """The split whose episodes are chosen from."""
    rows: int = 100
    """How many of its first rows."""
    runs: Path = Path("runs")
    """Folder of all runs."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import highlights

        chosen = highlights.choose(self.runs, self.reaches, self.split, self.rows)
        files = highlights.make(chosen, self.into)
        columns = ["method", "row", "score", "length", "cause"]
        cells = [
            [file.name, *row, round(file.stat().st_size / 1000)]
            for file, row in zip(files, chosen[columns].itertuples(index=False), strict=True)
        ]
        print_table(f"recordings in {self.into}", ["file", "method", "row", "return", "steps", "cause", "kB"], cells)
        return 0
