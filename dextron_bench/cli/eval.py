"""`dextron-bench eval`: evaluates shipped weights, or the weights in a file, without training."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE, EPISODES_FAILED
from dextron_bench.cli.support.method_flags import settings_dict
from dextron_bench.cli.support.output import progress_bar
from dextron_bench.cli.support.pieces import PieceFlags, Pieces
from dextron_bench.cli.support.standings import print_beside_published

if TYPE_CHECKING:
    from dextron_bench.runs import plans
    from dextron_bench.runs.evaluation_job import EvaluationJob


@dataclass(frozen=True)
class Eval:
    """Evaluate the shipped weights of a method, or the weights in a file, and print them beside the published rows.

    The settings of a method are flags too, as for `run`. The files go to the folder `eval` in the folder of runs.

    Example: dextron-bench eval --method rlil --dur 0.1 --preset quick --split test
    """

    method: flags.Method
    reaches: flags.Reaches = "synthetic"
    split: flags.EvalSplits = ()
    seed: tuple[int, ...] = ()
    """The seeds of the weights; by default all that ship."""
    weights: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """A file of weights to use instead of the shipped ones, such as weights.safetensors in the folder of a run."""
    record: int = 0
    """How many episodes of each split to record, from the first."""
    runs: flags.Runs = flags.RUNS
    threads: flags.Threads = 0
    pieces: Pieces = field(default_factory=PieceFlags)
    quiet: flags.Quiet = False
    json: bool = False
    """Print the rows as JSON."""
    method_settings: tyro.conf.Suppress[Any] = None

    def __call__(self) -> int:
        from dextron_bench.runs import execution, result_files

        self.pieces.check()
        runs, folder = self._runs(), self.runs / "eval"

        def works() -> list[EvaluationJob]:
            return [execution.prepare(run, folder, self.threads) for run in runs]

        if self.pieces.play(works, folder, self.threads, self.quiet):
            return DONE
        results = []
        for run in runs:
            with progress_bar(f"{run.label}, seed {run.seed}", self.quiet) as progress:
                execution.execute(run, folder, self.threads, progress)
            results.append(result_files.read_result(run.folder(folder).result))
        return EPISODES_FAILED if print_beside_published(results, runs[0].splits, self.json) else DONE

    def _runs(self) -> list[plans.Run]:
        """The runs to evaluate, one for each seed."""
        from dextron_bench.methods import weights as method_weights
        from dextron_bench.runs.plans import Plan, resolve, with_shipped_weights

        run = resolve(Plan(self.method, self.reaches, self.split, 0, self.record, settings_dict(self.method_settings)))
        if self.weights is None:
            return with_shipped_weights(run, self.seed)
        if len(self.seed) > 1:
            raise method_weights.BadWeights("a file holds the weights of one seed: give one --seed, or none")
        seed = self.seed[0] if self.seed else method_weights.seed_of(self.weights)
        return [run.with_weights(seed, self.weights)]
