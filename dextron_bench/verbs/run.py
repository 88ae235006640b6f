"""`dextron-bench run`: evaluate a method, record episodes, print its rows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dextron_bench.verbs.leaderboard import print_rows
from dextron_bench.verbs.printing import progress_bar

EPISODES_FAILED = 3


@dataclass(frozen=True)
class Run:
    """Run a method on the splits of a source of reaches, beside the floors, and print the leaderboard.

    What a run folder already holds is not computed again: the same command goes on where it was stopped.

    Example: dextron-bench run --method exp --reaches synthetic --split test --seed 0 1 2 --record 3
    """

    method: str = "exp"
    """A method's name (see `dextron-bench list`), module:Class or file.py:Class."""
    reaches: Literal["real", "synthetic"] = "synthetic"
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
    quiet: bool = False
    """Show no progress."""
    json: bool = False
    """Print the rows as JSON."""

    def __call__(self) -> int:
        from dextron_bench import leaderboard, run, splits

        names = self.split or splits.evaluated(self.reaches)
        floors = [name for name in ("nothing", "random") if self.floors and name != self.method]
        plans = [run.Plan(self.method, self.reaches, names, seed, self.record) for seed in self.seed]
        plans += [run.Plan(name, self.reaches, names, seed) for name in floors for seed in self.seed]
        found = []
        for plan in plans:
            with progress_bar(f"{plan.method}, seed {plan.seed}", self.quiet) as progress:
                folder = run.execute(plan, self.runs, self.threads, progress)
            found.append(run.read_result(folder / run.RESULT))
            if plan.record and not self.json:
                print(f"{folder}: results, provenance and recordings; open one with `dextron-bench view {folder}`")
        rows = leaderboard.table(found)
        print_rows(rows[rows["split"].isin(names)], self.json)
        return EPISODES_FAILED if rows["failed"].any() else 0
