"""`dextron-bench eval`: evaluate weights that ship, or a file's, without training."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from dextron_bench.cli.leaderboard import print_rows
from dextron_bench.cli.method_flags import chosen
from dextron_bench.cli.output import progress_bar
from dextron_bench.cli.run import EPISODES_FAILED

if TYPE_CHECKING:
    from dextron_bench.runs.plans import Plan


@dataclass(frozen=True)
class Eval:
    """Evaluate the weights of a trained method that ship with the package, or those of a file, and print its rows.

    A method's own settings are flags too, as for `run`. Files go to `eval` below the folder of runs.

    Example: dextron-bench eval --method rlil --dur 0.1 --preset quick --split test
    """

    method: str
    """A method's name (see `dextron-bench list`), module:Class or file.py:Class."""
    reaches: Literal["real", "synthetic", "minjerk"] = "synthetic"
    """The source of reaches."""
    split: tuple[str, ...] = ()
    """The splits to evaluate on; by default all that rank methods."""
    seed: tuple[int, ...] = ()
    """Seeds whose weights to take; by default all that ship."""
    weights: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """Weights to take in place of those that ship, such as weights.safetensors of a run's folder."""
    record: int = 0
    """Record the first so many episodes of each split."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor. Results do not depend on it."""
    quiet: bool = False
    """Show no progress."""
    json: bool = False
    """Print the rows as JSON."""
    settings: tyro.conf.Suppress[Any] = None

    def __call__(self) -> int:
        from dextron_bench.runs import execution, result_files
        from dextron_bench.scores import standings

        plans = self._plans()
        runs = self.runs / "eval"
        found = []
        for plan in plans:
            with progress_bar(f"{plan.label}, seed {plan.seed}", self.quiet) as progress:
                folder = execution.execute(plan, runs, self.threads, progress)
            found.append(result_files.read_result(folder / result_files.RESULT))
        rows = standings.table(found)
        print_rows(rows[rows["split"].isin(plans[0].splits)], self.json)
        return EPISODES_FAILED if rows["failed"].any() else 0

    def _plans(self) -> list[Plan]:
        """What to evaluate: a plan for each seed."""
        from dextron_bench.methods import registry
        from dextron_bench.methods import weights as methods_weights
        from dextron_bench.runs import plans as runs_plans
        from dextron_bench.splits.loading import ranking_splits

        settings = chosen(self.settings)
        names = self.split or ranking_splits(registry.run_source(registry.create(self.method, settings), self.reaches))
        plan = runs_plans.Plan(self.method, self.reaches, names, 0, self.record, settings)
        if self.weights is None:
            return runs_plans.shipped(plan, self.seed)
        if len(self.seed) > 1:
            raise methods_weights.BadWeights("the weights of a file are those of one seed: give one --seed, or none")
        seed = self.seed[0] if self.seed else methods_weights.seed(self.weights)
        return [replace(plan, seed=seed, weights=self.weights)]
