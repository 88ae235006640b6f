"""`dextron-bench data info`: describes a source of reaches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table


@dataclass(frozen=True)
class Info:
    """Show the number, duration, path length and speed of a source's reaches, by subject and by start region.

    Example: dextron-bench data info --reaches real --into reaches.png
    """

    reaches: flags.Reaches = "real"
    into: Path | None = None
    """Also draw all paths in 3D, coloured by start region, into this file (png, pdf or svg)."""
    json: bool = False
    """Print JSON, one object for each subject and start region."""

    def __call__(self) -> int:
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.reaches.summary import group_means, reach_table

        source = open_source(self.reaches)
        reaches = reach_table(source)
        if self.json:
            print_json(group_means(reaches, ["subject", "ring", "angle"]).to_dict("records"))
        else:
            for by in (["subject"], ["ring", "angle"]):
                table = group_means(reaches, by)
                title = f"{len(reaches)} {self.reaches} reaches by {' and '.join(by)}"
                columns = [*by, "reaches", "duration [s]", "length [m]", "speed [m/s]"]
                rows = table[[*by, "reaches", "duration", "length", "speed"]].itertuples(index=False)
                print_table(title, columns, rows)
        if self.into:
            from dextron_bench.scores.figures.reaches import reach_paths

            reach_paths(source, self.into)
        return DONE
