"""`dextron-bench runs rm`: removes runs."""

from __future__ import annotations

import sys
from dataclasses import dataclass

from dextron_bench.cli.support import flags, run_names
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_warning


class NotConfirmed(ValueError):
    """Runs that would be removed without a confirmation."""


@dataclass(frozen=True)
class Remove:
    """Remove runs with all their files, after a question.

    Of a run whose folder, or whose method's folder, is a link, only the link is removed. Its files stay, as do those to
    which links in a run's folder lead; a line names the place.

    Example: dextron-bench runs rm mine-near0.06/synthetic --yes
    """

    run: flags.RunNames
    runs: flags.Runs = flags.RUNS
    yes: bool = False
    """Remove them without a question."""

    def __call__(self) -> int:
        from dextron_bench.storage import folders

        places = run_names.folders(self.runs, self.run)
        if not self.yes:
            names = ", ".join(self.run)
            if not sys.stdin.isatty():
                raise NotConfirmed(f"{names} would be removed for good; confirm with --yes")
            if input(f"remove {names} for good? [y/N] ").strip().lower() not in ("y", "yes"):
                return DONE
        for folder in places:
            for target in folders.remove(folder):
                print_warning(f"only the link to {target} was removed; its files are still there")
            run_names.remove_if_empty(folder, self.runs)
        return DONE
