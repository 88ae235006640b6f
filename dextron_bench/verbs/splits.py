"""`dextron-bench splits`: make the splits from an expert database."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dextron_bench.verbs.printing import print_table


@dataclass(frozen=True)
class Splits:
    """Make the splits of a source from its expert database, with the difficulty of every row.

    The shipped splits are frozen; new ones are a new version, and their scores do not compare.

    Example: dextron-bench splits --reaches real --database runs/mc/real/seed0/experts-real.parquet --into new
    """

    reaches: Literal["real", "synthetic"]
    """The source of reaches."""
    database: Path
    """The expert database, as `dextron-bench mc` makes it."""
    into: Path
    """Folder to write splits.json and splits-<reaches>.parquet to; entries of other sources are kept."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor."""

    def __call__(self) -> int:
        from dextron_bench import database, montecarlo, partition
        from dextron_bench.world.engine import Engine
        from dextron_bench.world.sources import open_source

        engine = Engine(montecarlo.SLOTS, self.threads)
        rows, tried = database.load(self.database), database.summary(self.database)["search"]["experts"]
        entry = partition.build(open_source(self.reaches), rows, tried, self.into, engine)
        made = [(name, found["rows"], found["digest"][:8]) for name, found in entry.items()]
        print_table(f"splits of {self.reaches} reaches in {self.into}", ["split", "rows", "version"], made)
        return 0
