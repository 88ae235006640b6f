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
        from msgspec import structs

        from dextron_bench.storage import records
        from dextron_bench.success import training
        from dextron_bench.success.fit import Fit

        folder = folder_of(self.runs, self.reaches, self.data)
        with progress_bar("epochs", self.quiet) as progress:
            training.train(folder, training.TrainingConfig(epochs=self.epochs, seed=self.seed), progress)
        fit = records.read_about(folder / training.MODEL, Fit)
        best = structs.asdict(fit.curve[fit.best_epoch - 1])
        print_table("the best epoch on held-out settings", list(best), [list(best.values())])
        print(folder / training.MODEL)
        return DONE
