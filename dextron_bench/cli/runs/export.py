"""`dextron-bench runs export`: writes runs for MLflow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import print_warning


@dataclass(frozen=True)
class Export:
    """Write runs into a database of MLflow, with settings, scores and learning curves. Needs the extra `mlflow`.

    A run that is not finished is written as it is. A line names each run whose files cannot be read, and the exit code
    is 1; the others are written.

    Example: dextron-bench runs export --into exported
    """

    into: Path
    """The folder to write, new or empty; `cd FOLDER && mlflow ui` shows it."""
    run: Annotated[tuple[str, ...], tyro.conf.arg(metavar="RUN")] = ()
    """The runs; all by default."""
    runs: flags.Runs = flags.RUNS

    def __call__(self) -> int:
        from dextron_bench.catalogue import exported_runs, mlflow_export, run_catalogue

        left_out: list[str] = []
        entries = run_catalogue.entries(self.runs, left_out)
        chosen = [run_catalogue.find(entries, name) for name in self.run] if self.run else entries
        exported, of_seeds = exported_runs.collect(chosen)
        left_out += of_seeds
        mlflow_export.write(exported, self.into)
        print(f"{len(exported)} runs in {self.into / mlflow_export.DATABASE}")
        for line in left_out:
            print_warning(line)
        return DIFFERS if left_out else DONE
