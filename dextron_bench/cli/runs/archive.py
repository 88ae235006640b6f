"""`dextron-bench runs archive`: moves runs out of the way."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dextron_bench.cli.support import flags, run_names
from dextron_bench.cli.support.exit_codes import DONE

if TYPE_CHECKING:
    pass

ARCHIVE = "archive"  # Beside the folder of all runs, after its name.


class AlreadyArchived(ValueError):
    """An archive that holds a run of the same name."""


@dataclass(frozen=True)
class Archive:
    """Move runs out of the way, into a folder beside the folder of all runs; move them back to use them again.

    Of a run whose folder, or whose method's folder, is a link, the link moves and its files stay where they are.

    Example: dextron-bench runs archive mine-near0.06/synthetic
    """

    run: flags.RunNames
    runs: flags.Runs = flags.RUNS

    def __call__(self) -> int:
        from dextron_bench.storage import folders

        archive = self.runs.parent / f"{self.runs.name or Path.cwd().name}-{ARCHIVE}"
        places = {folder: archive / folder.relative_to(self.runs) for folder in run_names.folders(self.runs, self.run)}
        for folder, place in places.items():
            if os.path.lexists(place):
                raise AlreadyArchived(f"{place} exists; remove it, or give it another name")
            place.parent.mkdir(parents=True, exist_ok=True)
            folders.move(folder, place)
            run_names.remove_if_empty(folder, self.runs)
            print(place)
        return DONE
