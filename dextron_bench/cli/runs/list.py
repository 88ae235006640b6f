"""`dextron-bench runs list`: runs with their states and scores."""

from __future__ import annotations

import csv
import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from dextron_bench.catalogue.run_search import RunFilter
from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table
from dextron_bench.cli.support.run_cells import cell, plain

if TYPE_CHECKING:
    pass

COLUMNS = ("run", "state", "seeds", "val", "return", "success", "date", "tags", "note")
SPLIT = "test"  # By default; a folder may have no scores on it yet.


@dataclass(frozen=True)
class List:
    """List runs with their states and scores, a row for all seeds of a configuration.

    Example: dextron-bench runs list --method "rlil*" --sort return --split test
    """

    runs: flags.Runs = flags.RUNS
    filter: Annotated[RunFilter, tyro.conf.arg(name="")] = field(default_factory=RunFilter)
    split: str = SPLIT
    """The split of the columns `return` and `success`."""
    sort: Literal["name", "date", "val", "return", "success"] = "name"
    """The order: by name, newest first, or highest score first: return on val, or return or success on the split."""
    columns: tuple[str, ...] = COLUMNS
    """Columns: some of run, state, seeds, val, return, success, date, tags, note, splits, physics, settings.NAME."""
    json: bool = False
    """Print JSON."""
    csv: bool = False
    """Print comma-separated values."""

    def __call__(self) -> int:
        from dextron_bench.catalogue import run_catalogue, run_search

        known = run_catalogue.entries(self.runs)
        if self.split != SPLIT:
            run_search.check_split(known, self.split)
        entries = run_search.ordered(run_search.matching(known, self.filter, self.split), self.sort, self.split)
        rows = [{name: cell(entry, name, self.split) for name in self.columns} for entry in entries]
        if self.json:
            print_json(rows)
        elif self.csv:
            writer = csv.writer(sys.stdout, lineterminator="\n")
            writer.writerows([self.columns, *([plain(row[name]) for name in self.columns] for row in rows)])
        else:
            cells = [[_shown(row[name], name) for name in self.columns] for row in rows]
            print_table(f"runs in {self.runs}, scores on {self.split}", self.columns, cells)
            self._print_trainings()
        return DONE

    def _print_trainings(self) -> None:
        """Prints what is left of trainings, of failed runs too, if some are not over."""
        from dextron_bench.training import jobs

        left = jobs.unfinished(self.runs)
        trainings = [(one.label, one.reaches, " ".join(map(str, one.seeds)), one.left) for one in left]
        if trainings:
            print_table(f"trainings in {self.runs}", ["method", "reaches", "seeds", "left"], trainings)


def _shown(value: Any, name: str) -> str:
    """A value as a person reads it: scores rounded, success as a percentage."""
    if name == "success" and value is not None:
        return f"{100 * value:.1f} %"
    return f"{value:.2f}" if isinstance(value, float) else plain(value)
