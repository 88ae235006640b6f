"""`dextron-bench list`: lists methods, splits and runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_table


@dataclass(frozen=True)
class List:
    """List methods, splits and the runs in a folder.

    Example: dextron-bench list
    """

    runs: Path = Path("runs")
    """Folder of all runs."""

    def __call__(self) -> int:
        from dextron_bench.methods import registry
        from dextron_bench.runs import result_files
        from dextron_bench.splits.loading import all_splits, load_split
        from dextron_bench.training import jobs

        methods = [(name, registry.describe(name)) for name in registry.installed_methods()]
        splits = [load_split(*names) for names in all_splits()]
        rows = [(split.reaches, split.name, len(split), split.digest[:8]) for split in splits]
        print_table("methods", ["name", "description"], methods)
        print_table("splits", ["reaches", "split", "rows", "version"], rows)
        done = [(r["method"], r["reaches"], r["seed"], ", ".join(r["splits"])) for r in result_files.results(self.runs)]
        trainings = [(t.label, t.reaches, " ".join(map(str, t.seeds)), t.left) for t in jobs.unfinished(self.runs)]
        if trainings:
            print_table(f"trainings in {self.runs}", ["method", "reaches", "seeds", "left"], trainings)
        print_table(f"runs in {self.runs}", ["method", "reaches", "seed", "splits"], done)
        return DONE
