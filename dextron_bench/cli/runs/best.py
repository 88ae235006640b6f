"""`dextron-bench runs best`: the run with the highest mean return."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import tyro

from dextron_bench.catalogue.run_search import RunFilter
from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json


@dataclass(frozen=True)
class Best:
    """Print the run with the highest mean return on a split, by default `val`, which no ranking uses.

    Experts (`exp`) are left out: they are no entrant, and always best.

    Example: dextron-bench runs best --method "mine*" --split val
    """

    runs: flags.Runs = flags.RUNS
    filter: Annotated[RunFilter, tyro.conf.arg(name="")] = field(default_factory=RunFilter)
    split: str = "val"
    """The split; on `val`, a run that has not played it counts with the best point of its learning curves."""
    json: bool = False
    """Print JSON."""

    def __call__(self) -> int:
        from dextron_bench.catalogue import run_catalogue, run_search
        from dextron_bench.methods.registry import CEILINGS

        entrants = [entry for entry in run_catalogue.entries(self.runs) if entry.label not in CEILINGS]
        entries = run_search.ordered(run_search.matching(entrants, self.filter, self.split), "return", self.split)
        if not entries or entries[0].score(self.split) != entries[0].score(self.split):
            raise run_search.BadSearch(f"none of the {len(entries)} runs has a score on {self.split!r}")
        best = entries[0]
        row = {"run": best.name, "return": best.score(self.split), "success": best.score(self.split, "success")}
        row |= {"seeds": len(best.seeds), "settings": dict(best.settings)}
        if self.json:
            print_json(row)
        else:
            print(f"{best.name}: return {row['return']:.2f}, success {100 * row['success']:.1f} % on {self.split}")
        return DONE
