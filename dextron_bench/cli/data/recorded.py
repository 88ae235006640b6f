"""`dextron-bench data`: gets the recorded reaches, describes a source of reaches, compares outcomes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table, progress_bar
from dextron_bench.reaches.sources import SourceName
from dextron_bench.storage import home


@dataclass(frozen=True)
class Import:
    """Import the authors' 575 recorded reaches from their release, and verify every file.

    Example: dextron-bench data import --from dextron-a101b9e.zip
    """

    source: Annotated[Path, tyro.conf.arg(name="from", metavar="ZIP|FOLDER")]
    """The release: its zip, the unpacked folder, a checkout, or the folder data or extracts in it."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.reaches.recorded import cache

        with progress_bar("reaches", self.quiet) as progress:
            reaches = cache.import_release(home.expanded(self.source), progress=progress)
        print(f"{len(reaches)} reaches imported into {cache.cache_file()}")
        return DONE


@dataclass(frozen=True)
class Fetch:
    """Download the authors' release from GitHub and import it.

    Example: dextron-bench data fetch
    """

    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.reaches.recorded import cache, download

        with progress_bar("bytes", self.quiet) as progress:
            reaches = download.fetch(progress=progress)
        print(f"{len(reaches)} reaches imported into {cache.cache_file()}")
        return DONE


@dataclass(frozen=True)
class Info:
    """Show the number, duration, path length and speed of a source's reaches, by subject and by start region.

    Example: dextron-bench data info --reaches real --picture reaches.png
    """

    reaches: SourceName = "real"
    """The source of reaches."""
    picture: Path | None = None
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
        if self.picture:
            from dextron_bench.scores.figures.reaches import reach_paths

            reach_paths(source, self.picture)
        return DONE


@dataclass(frozen=True)
class Agreement:
    """Play settings and experts whose outcomes on another hand are known, and report how often the hands agree.

    Example: dextron-bench data agreement --with reference-outcomes.csv
    """

    file: Annotated[Path, tyro.conf.arg(name="with", metavar="CSV")]
    """Outcomes: reach, duration_noise, offset_x, offset_y, gain, critical_distance, return_on_mesh_hand, stratum."""
    quiet: bool = False
    """Show no progress."""
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
