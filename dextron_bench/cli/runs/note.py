"""`dextron-bench runs note`: writes a note to a run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import tyro

from dextron_bench.cli.support import flags, run_names
from dextron_bench.cli.support.exit_codes import DONE


@dataclass(frozen=True)
class Note:
    """Write a note to a run, in the place of its old one.

    Example: dextron-bench runs note rlil-0.1/real "The first run with the new rewards."
    """

    run: flags.RunName
    text: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TEXT")]
    """The note; an empty text removes it."""
    runs: flags.Runs = flags.RUNS

    def __call__(self) -> int:
        from dextron_bench.runs import annotations

        folder = run_names.find(self.runs, self.run).folder
        annotations.write(folder, replace(annotations.read(folder), note=self.text))
        return DONE
