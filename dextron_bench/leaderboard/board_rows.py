"""The rows of a board: the results in its folder, with their files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dextron_bench.errors import NotFound
from dextron_bench.evaluation.results import Result
from dextron_bench.leaderboard.collect import RESULTS
from dextron_bench.runs import result_files
from dextron_bench.storage.run_folder import RunFolder


@dataclass(frozen=True, slots=True)
class Row:
    """A result on the board."""

    run: RunFolder
    result: Result

    @property
    def name(self) -> str:
        """Method, source of reaches and seed, in words."""
        return f"{self.result.method}, {self.result.reaches} reaches, seed {self.result.seed}"


def rows(board: Path, methods: Sequence[str] = (), reaches: Sequence[str] = ()) -> list[Row]:
    """The rows of a board for these methods and sources, all if empty; raises NotFound, DamagedFile."""
    published = [Row(run, result_files.read_result(run.result)) for run in result_files.finished(board / RESULTS)]
    selected = [row for row in published if not methods or row.result.method in methods]
    selected = [row for row in selected if not reaches or row.result.reaches in reaches]
    if not selected:
        names = ", ".join(sorted({row.result.method for row in published})) or "none"
        raise NotFound(f"{board} has no such rows; its methods: {names}")
    return selected
