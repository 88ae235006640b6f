"""`dextron-bench data export`: writes episodes as a Minari data set."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table, progress_bar
from dextron_bench.storage import home

if TYPE_CHECKING:
    from dextron_bench.evaluation.minari_export import Player


@dataclass(frozen=True)
class Export:
    """Play episodes on a split and store them as a Minari data set for offline learning (needs the extra `minari`).

    The expert of each setting plays. With --policies, the policies in these files play instead, one after another.

    Example: dextron-bench data export --into datasets --reaches synthetic --split train --rows 200
    """

    into: Annotated[Path, tyro.conf.arg(metavar="FOLDER")]
    """The folder of all data sets: the reader's MINARI_DATASETS_PATH, by default ~/.minari/datasets."""
    reaches: flags.Reaches = "synthetic"
    split: str = "train"
    """The split."""
    rows: int = 200
    """How many of its rows to play, from the first."""
    policies: flags.Policies = ()
    """Weights of the policies that play instead of the experts."""
    name: str = ""
    """The name of the data set; by default reaches, split and players, such as dextron/real-train-experts-v0."""
    author: str = ""
    """The author of the data set; by default the contributors of dextron-bench."""
    threads: flags.Threads = 0
    quiet: flags.Quiet = False
    json: bool = False
    """Print the summary as JSON."""

    def __call__(self) -> int:
        from dextron_bench.evaluation import minari_export
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits import tracks
        from dextron_bench.splits.loading import load_split

        split = load_split(self.reaches, self.split)
        played = f"{self.reaches}-{self.split.replace(tracks.PLUS, '-')}"  # Minari's names have no +.
        name = self.name or f"dextron/{played}-{'policies' if self.policies else 'experts'}-v0"
        rows = min(self.rows, len(split))
        export = minari_export.Export(name, split, rows, self._players(), self.author or minari_export.CONTRIBUTORS)
        with progress_bar("episodes", self.quiet) as progress:
            folder = export.write(open_source(self.reaches), home.expanded(self.into), self.threads, progress)
        row = minari_export.summary(folder)
        if self.json:
            print_json({"name": name, "folder": str(folder), **row})
        else:
            print_table(f"Minari data set {name}", list(row), [list(row.values())])
            print(folder)
        return DONE

    def _players(self) -> list[Player]:
        from dextron_bench.evaluation import minari_export
        from dextron_bench.experts.policies import ExpertAgent
        from dextron_bench.methods import weights as methods_weights

        if not self.policies:
            return [minari_export.Player("expert", ExpertAgent())]
        return [
            minari_export.Player(str(file), methods_weights.load_agent_from_file(file), methods_weights.metadata(file))
            for file in self.policies
        ]
