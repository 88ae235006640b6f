"""`dextron-bench success data`: the data set of the success model."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table, progress_bar
from dextron_bench.cli.support.pieces import PieceFlags, Pieces
from dextron_bench.cli.support.success_models import folder_of


@dataclass(frozen=True)
class Data:
    """Play episodes of experts and of trained policies: the data set of the success model.

    If it is interrupted, the same command continues and gives the same data set.

    Example: dextron-bench success data --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: flags.RankedReaches = "synthetic"
    rows: int = 1_000_000
    """Play until there are this many transitions."""
    policies: flags.Policies = ()
    """Weights of the policies that play half of the episodes, in turn; by default experts play all episodes."""
    seed: int = 0
    """Seed of all draws."""
    threads: int = 0
    """Threads of the simulation; 0 means one per processor, and on a cluster one for each piece."""
    runs: Path = Path("runs")
    """Folder of all runs; also holds the data set."""
    pieces: Pieces = field(default_factory=PieceFlags)
    quiet: flags.Quiet = False
    json: bool = False
    """Print the summary as JSON."""

    def __call__(self) -> int:
        from dextron_bench.storage import hashing
        from dextron_bench.storage.pieces import Place
        from dextron_bench.success import generation

        self.pieces.check()
        policies = {hashing.sha256(file): file for file in self.policies}
        config = generation.DatasetConfig(self.reaches, self.seed, tuple(policies))
        folder = folder_of(self.runs, self.reaches, self.seed)
        work = generation.open_generation(Place(self.runs, folder, self.threads), config, self.rows, policies)
        if self.pieces.play_blocks(work, self.runs, self.threads, self.quiet):
            return DONE
        with progress_bar("transitions", self.quiet) as progress:
            tallies = work.run(progress)
        rows = [{"kind": kind, **tally.as_dict()} for kind, tally in tallies.items() if tally.rows]
        rows.append({"kind": "all", **sum(tallies.values(), generation.Tally()).as_dict()})
        if self.json:
            print_json(rows)
        else:
            print_table(f"data set in {folder}", list(rows[0]), [list(row.values()) for row in rows])
        return DONE
