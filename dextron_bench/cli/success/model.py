"""`dextron-bench success data` and `success train`: the data set of the success model, and its training."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table, progress_bar
from dextron_bench.cli.support.pieces import PieceFlags, Pieces
from dextron_bench.reaches.sources import RankedSource


@dataclass(frozen=True)
class Data:
    """Play episodes of experts and of trained policies: the data set of the success model.

    If it is interrupted, the same command continues and gives the same data set.

    Example: dextron-bench success data --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: RankedSource = "synthetic"
    """The source of reaches."""
    rows: int = 1_000_000
    """Play until there are this many transitions."""
    policies: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE.safetensors")] = ()
    """Weights of the policies that play half of the episodes, in turn; by default experts play all episodes."""
    seed: int = 0
    """Seed of all draws."""
    threads: int = 0
    """Threads of the simulation; 0 means one per processor, and on a cluster one for each piece."""
    runs: Path = Path("runs")
    """Folder of all runs; also holds the data set."""
    pieces: Pieces = field(default_factory=PieceFlags)
    quiet: bool = False
    """Show no progress."""
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


@dataclass(frozen=True)
class Train:
    """Train the success model on a data set of `success data`; a fifth of the settings is held out.

    If it is interrupted, the same command continues and gives the same bytes.

    Example: dextron-bench success train --reaches synthetic --epochs 30
    """

    reaches: RankedSource = "synthetic"
    """The source of reaches."""
    data: int = 0
    """Seed of the data set."""
    epochs: int = 30
    """Number of epochs; an epoch has 1,000 batches."""
    seed: int = 0
    """Seed of the network and of its batches."""
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
        training_info = tensors.read_about(folder / training.MODEL)
        best = training_info["curve"][training_info["best_epoch"] - 1]
        columns = ["epoch", "loss", "accuracy", "test_loss", "test_accuracy"]
        print_table("the best epoch on held-out settings", columns, [[best[column] for column in columns]])
        print(folder / training.MODEL)
        return DONE


def folder_of(runs: Path, reaches: str, seed: int) -> Path:
    """The folder of a data set and of the model that is trained on it."""
    return runs / "success" / reaches / f"seed{seed}"
