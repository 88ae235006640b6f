"""`dextron-bench figures`: the paper's figures from the shipped data."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class Figures:
    """Draw the paper's figure 3 (all reaches, and where those that can be grasped start) and the README's pictures.

    Example: dextron-bench figures --reaches synthetic --into figures
    """

    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    into: Path = Path("figures")
    """Folder for the pictures."""
    rows: int = 3000
    """Points in figure 3a at most."""

    def __call__(self) -> int:
        from dextron_bench import database, figures, partition, pictures
        from dextron_bench.world.sources import open_source

        source = open_source(self.reaches)
        self.into.mkdir(parents=True, exist_ok=True)
        solved = database.shipped(self.reaches)[0].query("score == 20")
        solved = solved.drop_duplicates(partition.SETTING).head(self.rows)
        starts, paths = (self.into / f"fig3{part}-{self.reaches}.png" for part in "ab")
        figures.start_points(source, solved, starts)
        figures.reach_paths(source, paths)
        print(starts, paths, *pictures.write_pictures(self.into), sep="\n")
        return 0
