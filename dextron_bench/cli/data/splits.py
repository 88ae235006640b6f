"""`dextron-bench data splits`: lists the splits, or builds the splits of a source of reaches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_table
from dextron_bench.reaches.sources import SourceName

if TYPE_CHECKING:
    import pandas as pd


class NeedsSource(ValueError):
    """Splits are built of one source of reaches, and none was given."""


class NeedsDatabase(ValueError):
    """The splits of this source are built from an expert database, and none was given."""


class NeedsSplits(FileNotFoundError):
    """The folder has no splits to which other bottles could be added."""


@dataclass(frozen=True)
class Splits:
    """List the splits that ship; with --into, build the splits of a source from its expert database.

    Every row that is built has its difficulty.
    With --bottles, build the rows of the tracks with other bottles, from the splits that are in the folder.

    The shipped splits are frozen. New splits are a new version, and their scores are not comparable with the old ones.

    Example: dextron-bench data splits --reaches real --database runs/mc/real/seed0/experts-real.parquet --into new
    """

    reaches: SourceName | None = None
    """The source of reaches; by default all are listed."""
    into: Path | None = None
    """Build splits.json and splits-<reaches>.parquet in this folder; entries of other sources are kept."""
    database: Path | None = None
    """The expert database that `dextron-bench data mc` wrote; not needed for `minjerk`, which has one expert."""
    bottles: bool = False
    """Build only the tracks with other bottles."""
    runs: Path = Path("runs")
    """Folder of all runs; also holds the scans, so that the same command continues after an interruption."""
    threads: flags.Threads = 0

    def __call__(self) -> int:
        if self.into is None:
            return self._list()
        if self.reaches is None:
            raise NeedsSource("--into builds the splits of one source: give --reaches")
        entry = self._build(self.reaches, self.into)
        rows = [(name, split["rows"], split["digest"][:8]) for name, split in entry.items()]
        print_table(f"splits of {self.reaches} reaches in {self.into}", ["split", "rows", "version"], rows)
        return DONE

    def _list(self) -> int:
        from dextron_bench.splits.loading import all_splits, load_split

        splits = [load_split(*names) for names in all_splits() if self.reaches in (None, names[0])]
        rows = [(split.reaches, split.name, len(split), split.digest[:8]) for split in splits]
        print_table("splits", ["reaches", "split", "rows", "version"], rows)
        return DONE

    def _build(self, reaches: SourceName, into: Path) -> dict[str, dict[str, Any]]:
        from dextron_bench.experts import database as experts_database
        from dextron_bench.experts import montecarlo
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits import bottles, building, building_minjerk
        from dextron_bench.splits.scanning import Scanner
        from dextron_bench.world.engine import Engine

        engine = Engine(montecarlo.SLOTS, self.threads)
        source, scans = open_source(reaches), self.runs / "splits" / reaches
        if self.bottles:
            table = _table(into / f"splits-{reaches}.parquet")
            return bottles.build(Scanner(source, engine, scans), table, into)
        if reaches == "minjerk":
            return building_minjerk.build(into, engine)
        if self.database is None:
            raise NeedsDatabase(f"splits of {reaches} reaches need --database, which `dextron-bench data mc` writes")
        rows, summary = experts_database.load(self.database), experts_database.summary(self.database)
        entry, distance = building.build(Scanner(source, engine, scans), rows, summary, into)
        print(f"best distance of the rule of thumb on val: {distance:g} m")
        return entry


def _table(file: Path) -> pd.DataFrame:
    """The table of splits in a file; raises NeedsSplits."""
    import pandas as pd

    try:
        return pd.read_parquet(file)
    except (OSError, ValueError) as error:
        raise NeedsSplits(f"--bottles needs {file}: build the splits first, without --bottles ({error})") from error
