"""`dextron-bench data export`: episodes as a Minari data set."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from dextron_bench.cli.output import print_json, print_table, progress_bar

if TYPE_CHECKING:
    from dextron_bench.evaluation.minari_export import Player


@dataclass(frozen=True)
class Export:
    """Play episodes on a split and store them as a Minari data set, for offline learning (needs the extra `minari`).

    Each setting's own expert plays or, where files of weights are given, their policies do, one after the other.

    Example: dextron-bench data export --into datasets --reaches synthetic --split train --rows 200
    """

    into: Annotated[Path, tyro.conf.arg(metavar="FOLDER")]
    """Where data sets live: MINARI_DATASETS_PATH of whoever loads it, by default ~/.minari/datasets."""
    reaches: Literal["real", "synthetic", "minjerk"] = "synthetic"
    """The source of reaches."""
    split: str = "train"
    """The split."""
    rows: int = 200
    """Play the first so many of its rows."""
    weights: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE.safetensors")] = ()
    """Weights of the policies that play in place of experts."""
    name: str = ""
    """The data set's name; by default it says reaches, split and who plays, as dextron/real-train-experts-v0."""
    author: str = ""
    """Who stands as its author; by default the contributors of dextron-bench."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor. The data set does not depend on it."""
    quiet: bool = False
    """Show no progress."""
    json: bool = False
    """Print the summary as JSON."""

    def __call__(self) -> int:
        from dextron_bench.evaluation import minari_export
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits.loading import load_split

        split = load_split(self.reaches, self.split)
        name = self.name or f"dextron/{self.reaches}-{self.split}-{'policies' if self.weights else 'experts'}-v0"
        rows = min(self.rows, len(split.cases))
        wanted = minari_export.Export(name, split, rows, self._players(), self.author or minari_export.CONTRIBUTORS)
        with progress_bar("episodes", self.quiet) as progress:
            found = wanted.write(open_source(self.reaches), self.into.expanduser(), self.threads, progress)
        row = minari_export.summary(found)
        if self.json:
            print_json({"name": name, "folder": str(found), **row})
        else:
            print_table(f"Minari data set {name}", list(row), [list(row.values())])
            print(found)
        return 0

    def _players(self) -> list[Player]:
        from dextron_bench.evaluation import minari_export
        from dextron_bench.experts.policies import ExpertAgent
        from dextron_bench.methods import weights as methods_weights

        if not self.weights:
            return [minari_export.Player("expert", ExpertAgent())]
        return [
            minari_export.Player(str(file), methods_weights.load_agent_from_file(file), methods_weights.metadata(file))
            for file in self.weights
        ]
