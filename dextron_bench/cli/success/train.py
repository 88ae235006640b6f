"""`dextron-bench success train`: trains the success model."""

from __future__ import annotations

from dataclasses import dataclass

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_table, progress_bar
from dextron_bench.cli.support.success_models import folder_of


@dataclass(frozen=True)
class Train:
    """Train the success model on a data set of `success data`; a fifth of the settings is held out.

    If it is interrupted, the same command continues and gives the same bytes.

    Example: dextron-bench success train --reaches synthetic --epochs 30
    """

    reaches: flags.RankedReaches = "synthetic"
    data: int = 0
    """Seed of the data set."""
    epochs: int = 30
    """Number of epochs; an epoch has 1,000 batches."""
    seed: int = 0
    """Seed of the network and of its batches."""
    runs: flags.Runs = flags.RUNS
    quiet: flags.Quiet = False

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
