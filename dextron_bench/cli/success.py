"""`dextron-bench success`: the success model's data set, its training, and how good it is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from dextron_bench.cli.output import print_json, print_table, progress_bar


@dataclass(frozen=True)
class Data:
    """Play the episodes that the success model learns from: of experts, and of trained policies.

    Killed at any moment, the same command goes on where it was and makes the same data set.

    Example: dextron-bench success data --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    rows: int = 1_000_000
    """Play until there are so many transitions."""
    policies: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE.safetensors")] = ()
    """Weights of the policies that play half of the episodes, in turn; without any, all are the experts'."""
    seed: int = 0
    """Seed of all draws."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor."""
    runs: Path = Path("runs")
    """Folder of all runs; the data set lives below it."""
    quiet: bool = False
    """Show no progress."""
    json: bool = False
    """Print the summary as JSON."""

    def __call__(self) -> int:
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits.loading import load_split
        from dextron_bench.storage import hashing
        from dextron_bench.success import generation

        agents = {hashing.sha256(file): weights.load_agent_from_file(file) for file in self.policies}
        wanted = generation.DatasetConfig(self.reaches, self.seed, tuple(agents))
        source, train = open_source(self.reaches), load_split(self.reaches, "train").cases
        folder = folder_of(self.runs, self.reaches, self.seed)
        with progress_bar("transitions", self.quiet) as progress:
            found = generation.generate(source, train, wanted, folder, self.rows, agents, self.threads, progress)
        rows = [{"kind": kind, **tally.as_dict()} for kind, tally in found.items() if tally.rows]
        rows.append({"kind": "all", **sum(found.values(), generation.Tally()).as_dict()})
        if self.json:
            print_json(rows)
        else:
            print_table(f"data set in {folder}", list(rows[0]), [list(row.values()) for row in rows])
        return 0


@dataclass(frozen=True)
class Train:
    """Train the success model on a data set that `success data` made; four in five of its episodes are learned from.

    Killed at any moment, the same command goes on and ends with the same bytes.

    Example: dextron-bench success train --reaches synthetic --epochs 30
    """

    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    data: int = 0
    """Seed of the data set."""
    epochs: int = 30
    """How long to train, in epochs of 1,000 batches."""
    seed: int = 0
    """Seed of the network and its batches."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.storage import tensors
        from dextron_bench.success import training

        folder = folder_of(self.runs, self.reaches, self.data)
        with progress_bar("epochs", self.quiet) as progress:
            training.train(folder, training.TrainingConfig(epochs=self.epochs, seed=self.seed), progress)
        told = tensors.read_about(folder / training.MODEL)
        best = told["curve"][told["best_epoch"] - 1]
        columns = ["epoch", "loss", "accuracy", "test_loss", "test_accuracy"]
        print_table("the best epoch on episodes held out", columns, [[best[column] for column in columns]])
        print(folder / training.MODEL)
        return 0


def folder_of(runs: Path, reaches: str, seed: int) -> Path:
    """Where a data set lives, and what is trained on it."""
    return runs / "success" / reaches / f"seed{seed}"
