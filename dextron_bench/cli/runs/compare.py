"""`dextron-bench runs compare`: what differs between runs, and their scores and learning curves beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table
from dextron_bench.cli.support.run_cells import INTERVALS, code_of, interval_text, plain

if TYPE_CHECKING:
    from dextron_bench.catalogue.run_catalogue import Entry


class NoCurves(ValueError):
    """A picture of learning curves is asked for, of runs that have none."""


@dataclass(frozen=True)
class Compare:
    """Compare runs: the settings that differ, the scores with intervals, and the learning curves in one picture.

    `dextron-bench compare` tests two methods on equal settings.

    Example: dextron-bench runs compare rl-hold40/real rlil-0.1/real --into curves.png
    """

    run: flags.RunNames
    runs: flags.Runs = flags.RUNS
    into: flags.Picture = None
    """Draw the learning curves into this file."""
    json: bool = False
    """Print JSON."""

    def __call__(self) -> int:
        from dextron_bench.catalogue import run_catalogue, run_search

        known = run_catalogue.entries(self.runs)
        entries = [run_catalogue.find(known, name) for name in self.run]
        if self.into is not None and not any(entry.curves for entry in entries):
            raise NoCurves("none of these runs has a learning curve to draw: leave out --into")
        names = run_search.differing_settings(entries)
        settings = {entry.name: {name: _setting(entry, name) for name in names} for entry in entries}
        scores = _scores(entries)
        if self.json:
            print_json({"settings": settings, "scores": scores})
        else:
            rows = [[name, *(plain(settings[entry.name][name]) for entry in entries)] for name in names]
            print_table("settings that differ", ["", *(entry.name for entry in entries)], rows)
            cells = [[plain(value) for value in row.values()] for row in scores]
            print_table("scores", list(scores[0]) if scores else ["split"], cells)
        if self.into is not None:
            _draw(entries, self.into)
        return DONE


def _setting(entry: Entry, name: str) -> Any:
    return {"code": code_of(entry), "physics": entry.physics, **entry.settings}.get(name)


def _scores(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """Two rows for each split, with each run's mean return and its success rate [%], and their intervals."""
    splits = dict.fromkeys(split for entry in entries for split in entry.scores)
    return [
        {"split": f"{split}, {what}", **{entry.name: interval_text(entry, split, what) for entry in entries}}
        for split in splits
        for what in INTERVALS
    ]


def _draw(entries: Sequence[Entry], file: Path) -> None:
    import pandas as pd

    from dextron_bench.scores.figures.training import learning_curves

    curves = {
        entry.name: {seed: pd.DataFrame(points) for seed, points in entry.curves.items()}
        for entry in entries
        if entry.curves
    }
    learning_curves(curves, pd.DataFrame(columns=["split", "method", "return"]), file)
