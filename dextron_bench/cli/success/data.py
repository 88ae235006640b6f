"""`dextron-bench success data`: the data set of the success model."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support import flags, pieces
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table, progress_bar
from dextron_bench.cli.support.success_models import folder_of

if TYPE_CHECKING:
    from dextron_bench.success.generation import DatasetConfig


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
    pieces: Annotated[pieces.Pieces, tyro.conf.arg(name="")] = field(default_factory=pieces.Pieces)
    quiet: flags.Quiet = False
    json: bool = False
    """Print the summary as JSON."""

    def __call__(self) -> int:
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits.loading import load_split
        from dextron_bench.storage import hashing
        from dextron_bench.success import generation, sharing

        share = self.pieces.parsed()
        files = {hashing.sha256(file): file for file in self.policies}
        agents = {name: weights.load_agent_from_file(file) for name, file in files.items()}
        config = generation.DatasetConfig(self.reaches, self.seed, tuple(agents))
        source, train = open_source(self.reaches), load_split(self.reaches, "train")
        folder = folder_of(self.runs, self.reaches, self.seed)
        if share is not None:
            with progress_bar(f"blocks of share {share}", self.quiet) as progress:
                count = sharing.generate_share(
                    source, train, config, folder, self.rows, agents, share, self.threads, progress
                )
            return pieces.print_done(share, f"{count} blocks", folder)
        if self.pieces.merge:
            sharing.check_complete(folder, config, self.rows)
        if self.pieces.cluster:
            self._play_on_cluster(config, folder, files)
        with progress_bar("transitions", self.quiet) as progress:
            tallies = generation.generate(source, train, config, folder, self.rows, agents, self.threads, progress)
        rows = [{"kind": kind, **tally.as_dict()} for kind, tally in tallies.items() if tally.rows]
        rows.append({"kind": "all", **sum(tallies.values(), generation.Tally()).as_dict()})
        if self.json:
            print_json(rows)
        else:
            print_table(f"data set in {folder}", list(rows[0]), [list(row.values()) for row in rows])
        return DONE

    def _play_on_cluster(self, config: DatasetConfig, folder: Path, policies: dict[str, Path]) -> None:
        from dextron_bench.cluster import datasets

        with (
            pieces.connected(self.pieces.cluster, self.runs, self.threads) as cluster,
            progress_bar("transitions", self.quiet) as progress,
        ):
            datasets.play_blocks(cluster, config, folder, self.runs, self.rows, policies, progress)
