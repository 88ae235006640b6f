"""`dextron-bench splits`: make the splits of a source of reaches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from dextron_bench.cli.output import print_table


class NeedsDatabase(ValueError):
    """A source whose splits come from an expert database, asked for without one."""


@dataclass(frozen=True)
class Splits:
    """Make the splits of a source from its expert database, with the difficulty of every row.

    The shipped splits are frozen; new ones are a new version, and their scores do not compare.

    Example: dextron-bench splits --reaches real --database runs/mc/real/seed0/experts-real.parquet --into new
    """

    reaches: Literal["real", "synthetic", "minjerk"]
    """The source of reaches."""
    into: Path
    """Folder to write splits.json and splits-<reaches>.parquet to; entries of other sources are kept."""
    database: Path | None = None
    """The expert database, as `dextron-bench mc` makes it; `minjerk` has one expert, and takes none."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor."""

    def __call__(self) -> int:
        entry = self._build()
        made = [(name, found["rows"], found["digest"][:8]) for name, found in entry.items()]
        print_table(f"splits of {self.reaches} reaches in {self.into}", ["split", "rows", "version"], made)
        return 0

    def _build(self) -> dict[str, dict[str, Any]]:
        from dextron_bench.experts import database as experts_database
        from dextron_bench.experts import montecarlo
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits import building, building_minjerk
        from dextron_bench.world.engine import Engine

        engine = Engine(montecarlo.SLOTS, self.threads)
        if self.reaches == "minjerk":
            return building_minjerk.build(self.into, engine)
        if self.database is None:
            raise NeedsDatabase(f"splits of {self.reaches} reaches need --database, as `dextron-bench mc` makes it")
        rows, tried = experts_database.load(self.database), experts_database.summary(self.database)["search"]["experts"]
        return building.build(open_source(self.reaches), rows, tried, self.into, engine)
