"""`dextron-bench runs tag`: adds tags to a run, or removes them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import tyro

from dextron_bench.cli.support import flags, run_names
from dextron_bench.cli.support.exit_codes import DONE


@dataclass(frozen=True)
class Tag:
    """Add tags to a run, or remove them.

    Example: dextron-bench runs tag rlil-0.1/real baseline paper
    """

    run: flags.RunName
    tags: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="TAG")]
    """The tags."""
    remove: bool = False
    """Remove these tags instead."""
    runs: flags.Runs = flags.RUNS

    def __call__(self) -> int:
        from dextron_bench.runs import annotations

        folder = run_names.find(self.runs, self.run).folder
        notes = annotations.read(folder)
        others = tuple(tag for tag in notes.tags if tag not in self.tags)
        annotations.write(folder, replace(notes, tags=others if self.remove else (*others, *self.tags)))
        return DONE
