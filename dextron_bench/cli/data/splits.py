"""`dextron-bench splits`: builds the splits of a source of reaches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_table
from dextron_bench.reaches.sources import SourceName

if TYPE_CHECKING:
    import pandas as pd


class NeedsDatabase(ValueError):
    """The splits of this source are built from an expert database, and none was given."""


class NeedsSplits(FileNotFoundError):
    """The folder has no splits to which other bottles could be added."""


@dataclass(frozen=True)
class Splits:
    """Build the splits of a source from its expert database, with the difficulty of every row.

    With --bottles, build the rows of the tracks with other bottles, from the splits that are in the folder.

    The shipped splits are frozen. New splits are a new version, and their scores are not comparable with the old ones.

    Example: dextron-bench splits --reaches real --database runs/mc/real/seed0/experts-real.parquet --into new
    """

    reaches: SourceName
    """The source of reaches."""
    into: Path
    """The folder for splits.json and splits-<reaches>.parquet; entries of other sources are kept."""
    database: Path | None = None
    """The expert database that `dextron-bench mc` wrote; not needed for `minjerk`, which has one expert."""
    bottles: bool = False
    """Build only the tracks with other bottles."""
    runs: Path = Path("runs")
    """Folder of all runs; also holds the scans, so that the same command continues after an interruption."""
    threads: int = 0
    """Threads of the simulation; 0 means one per processor."""

    def __call__(self) -> int:
        entry = self._build()
        rows = [(name, split["rows"], split["digest"][:8]) for name, split in entry.items()]
        print_table(f"splits of {self.reaches} reaches in {self.into}", ["split", "rows", "version"], rows)
        return DONE

    def _build(self) -> dict[str, dict[str, Any]]:
        from dextron_bench.experts import database as experts_database
        from dextron_bench.experts import montecarlo
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits import bottles, building, building_minjerk
        from dextron_bench.splits.scanning import Scanner
        from dextron_bench.world.engine import Engine

        engine = Engine(montecarlo.SLOTS, self.threads)
        source, scans = open_source(self.reaches), self.runs / "splits" / self.reaches
        if self.bottles:
            table = self._table()
            return bottles.build(Scanner(source, engine, scans), table, self.into)
        if self.reaches == "minjerk":
            return building_minjerk.build(self.into, engine)
        if self.database is None:
            raise NeedsDatabase(f"splits of {self.reaches} reaches need --database, which `dextron-bench mc` writes")
        rows, summary = experts_database.load(self.database), experts_database.summary(self.database)
        entry, distance = building.build(Scanner(source, engine, scans), rows, summary, self.into)
        print(f"best distance of the rule of thumb on val: {distance:g} m")
        return entry

    def _table(self) -> pd.DataFrame:
        """The table of the splits in the folder; raises NeedsSplits."""
        import pandas as pd

        file = self.into / f"splits-{self.reaches}.parquet"
        try:
            return pd.read_parquet(file)
        except (OSError, ValueError) as error:
            raise NeedsSplits(f"--bottles needs {file}: build the splits first, without --bottles ({error})") from error
