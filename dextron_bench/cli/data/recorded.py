"""`dextron-bench data import` and `data fetch`: get the recorded reaches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import progress_bar
from dextron_bench.storage import home


@dataclass(frozen=True)
class Import:
    """Import the authors' 575 recorded reaches from their release, and verify every file.

    Example: dextron-bench data import --from dextron-a101b9e.zip
    """

    source: Annotated[Path, tyro.conf.arg(name="from", metavar="ZIP|FOLDER")]
    """The release: its zip, the unpacked folder, a checkout, or the folder data or extracts in it."""
    quiet: flags.Quiet = False

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

    quiet: flags.Quiet = False

    def __call__(self) -> int:
        from dextron_bench.reaches.recorded import cache, download

        with progress_bar("bytes", self.quiet) as progress:
            reaches = download.fetch(progress=progress)
        print(f"{len(reaches)} reaches imported into {cache.cache_file()}")
        return DONE
