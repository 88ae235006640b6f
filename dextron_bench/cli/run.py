"""`dextron-bench run`: train a method, evaluate it, record episodes, print its rows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from dextron_bench.cli.leaderboard import print_rows
from dextron_bench.cli.method_flags import chosen
from dextron_bench.cli.output import print_json, print_table, progress_bar

if TYPE_CHECKING:
    from dextron_bench.runs import plans

EPISODES_FAILED = 3


@dataclass(frozen=True)
class Run:
    """Run a method on the splits of a source of reaches, beside the floors, and print the leaderboard.

    A method that learns is trained first, all seeds together. A method's own settings are flags too:
    `dextron-bench run --method rlil --help` shows them. What a run folder already holds is not computed again:
    the same command goes on where it was stopped.

    Example: dextron-bench run --method rlil --dur 0.1 --preset smoke --reaches synthetic --seed 0 1 2
    """

    method: str = "exp"
    """A method's name (see `dextron-bench list`), module:Class or file.py:Class."""
    all: bool = False
    """Run every method of the paper's table in place of one; --preset then holds for all that train."""
    reaches: Literal["real", "synthetic", "minjerk"] = "synthetic"
    """The source of reaches."""
    split: tuple[str, ...] = ()
    """The splits to evaluate on; by default all that rank methods."""
    seed: tuple[int, ...] = (0,)
    """Seeds of the agent."""
    record: int = 1
    """Record the first so many episodes of each split."""
    floors: bool = True
    """Also evaluate the do-nothing and the random agent, for comparison."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor. Results do not depend on it."""
    device: Literal["cpu", "cuda", "auto"] = "cpu"
    """What networks are trained on; auto takes a GPU where there is one. The last bits depend on it."""
    dry_run: bool = False
    """Only say what there is to do and about how long it takes."""
    quiet: bool = False
    """Show no progress."""
    json: bool = False
    """Print the rows as JSON."""
    settings: tyro.conf.Suppress[Any] = None

    def __call__(self) -> int:
        groups = self._groups()
        return self._foretell(groups) if self.dry_run else self._execute(groups)

    def _groups(self) -> list[list[plans.Run]]:
        """What to run: methods, each with its seeds."""
        from dextron_bench.methods import registry
        from dextron_bench.runs.plans import Plan, resolve

        settings = chosen(self.settings)
        methods = registry.paper_methods(**settings) if self.all else [(self.method, settings)]
        runs = [resolve(Plan(spec, self.reaches, self.split, 0, self.record, flags)) for spec, flags in methods]
        reaches = self.reaches if self.all else runs[0].source
        floors = [name for name in registry.FLOORS if self.floors and name != self.method]
        runs += [resolve(Plan(name, reaches, self.split)) for name in floors]
        return [[run.with_seed(seed) for seed in dict.fromkeys(self.seed)] for run in runs]

    def _execute(self, groups: list[list[plans.Run]]) -> int:
        from dextron_bench.runs import execution, result_files
        from dextron_bench.scores import standings

        results = []
        for group in groups:
            with progress_bar(f"{group[0].label}, epochs", self.quiet) as progress:
                execution.train(group, self.runs, self.threads, self.device, progress)
            for run in group:
                with progress_bar(f"{run.label}, seed {run.seed}", self.quiet) as progress:
                    folder = execution.execute(run, self.runs, self.threads, progress)
                results.append(result_files.read_result(run.folder(self.runs).result))
                if run.plan.record and not self.json:
                    print(f"{folder}: results, provenance and recordings; open one with `dextron-bench view {folder}`")
        rows = standings.table(results)
        rows = rows[rows["split"].isin({name for group in groups for name in group[0].splits})]
        print_rows(rows, self.json)
        return EPISODES_FAILED if rows["failed"].any() else 0

    def _foretell(self, groups: list[list[plans.Run]]) -> int:
        from dextron_bench.runs.estimates import estimate

        rows = estimate(groups, self.runs, self.threads, self.device)
        if self.json:
            print_json(rows)
            return 0
        cells = [
            [row["what"], row["method"], row["reaches"], " ".join(map(str, row["seeds"])), row["left"], told(row)]
            for row in rows
        ]
        print_table("left to do", ["what", "method", "reaches", "seeds", "left", "time"], cells)
        return 0


def told(row: dict[str, Any]) -> str:
    """About how long something takes, in words."""
    seconds = row["seconds"]
    if seconds is None:
        return "unknown"
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
