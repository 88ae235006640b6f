"""`dextron-bench data agreement`: compares outcomes with those on another hand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table, progress_bar
from dextron_bench.storage import home


@dataclass(frozen=True)
class Agreement:
    """Play settings and experts whose outcomes on another hand are known, and report how often the hands agree.

    Example: dextron-bench data agreement --with reference-outcomes.csv
    """

    file: Annotated[Path, tyro.conf.arg(name="with", metavar="CSV")]
    """Outcomes: reach, duration_noise, offset_x, offset_y, gain, critical_distance, return_on_mesh_hand, stratum."""
    quiet: flags.Quiet = False
    json: bool = False
    """Print JSON, one object for each stratum."""

    def __call__(self) -> int:
        from dextron_bench.evaluation import agreement
        from dextron_bench.reaches.sources import open_source

        outcomes = agreement.read(home.expanded(self.file))
        source = open_source("real")
        with progress_bar("episodes", self.quiet) as progress:
            returns = agreement.play(outcomes, source, progress)
        table = agreement.by_stratum(outcomes, returns)
        if self.json:
            print_json(table.to_dict("records"))
        else:
            columns = ["stratum", "rows", "equal success [%]", "standard error", "equal return [%]"]
            columns += ["theirs [%]", "ours [%]", "only theirs", "only ours"]
            shares = ["agreement", "standard_error", "same_return", "theirs", "ours"]
            rows = table.assign(**{name: 100.0 * table[name] for name in shares}).itertuples(index=False)
            print_table(f"agreement with {self.file.name}", columns, rows)
        return DONE
