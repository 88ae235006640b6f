"""`dextron-bench data`: the recorded reaches, and what a source holds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from dextron_bench.cli.output import print_json, print_table, progress_bar


@dataclass(frozen=True)
class Import:
    """Import the authors' 575 recorded reaches from their release, checking every file.

    Example: dextron-bench data import --from dextron-a101b9e.zip
    """

    source: Annotated[Path, tyro.conf.arg(name="from", metavar="ZIP|FOLDER")]
    """The release: its zip, its unpacked folder, a checkout, or the data or extracts folder in it."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.reaches.recorded import cache

        with progress_bar("reaches", self.quiet) as progress:
            reaches = cache.import_release(self.source.expanduser(), progress=progress)
        print(f"{len(reaches)} reaches imported into {cache.cache_file()}")
        return 0


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
        return 0


@dataclass(frozen=True)
class Info:
    """Show what a source holds, by subject and by start region: number, duration, path length, speed.

    Example: dextron-bench data info --reaches real --picture reaches.png
    """

    reaches: Literal["real", "synthetic", "minjerk"] = "real"
    """The source of reaches."""
    picture: Path | None = None
    """Also draw all paths in 3D, coloured by start region, into this file (png, pdf or svg)."""
    json: bool = False
    """Print JSON, one object for each subject and start region."""

    def __call__(self) -> int:
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.reaches.summary import group_means, reach_table

        source = open_source(self.reaches)
        found = reach_table(source)
        if self.json:
            print_json(group_means(found, ["subject", "ring", "angle"]).to_dict("records"))
        else:
            for by in (["subject"], ["ring", "angle"]):
                table = group_means(found, by)
                title = f"{len(found)} {self.reaches} reaches by {' and '.join(by)}"
                columns = [*by, "reaches", "duration [s]", "length [m]", "speed [m/s]"]
                rows = table[[*by, "reaches", "duration", "length", "speed"]].itertuples(index=False)
                print_table(title, columns, rows)
        if self.picture:
            from dextron_bench.scores.figures import reach_paths

            reach_paths(source, self.picture)
        return 0
