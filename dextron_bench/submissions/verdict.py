"""The findings of verification, for each seed of a submission and for the whole submission."""

from __future__ import annotations

from dataclasses import dataclass, field

import pandas as pd

from dextron_bench.evaluation.results import Result
from dextron_bench.submissions.manifest import Manifest

SHOWN = 5  # Problems of one kind that are listed one by one.


@dataclass(slots=True)
class SeedFinding:
    """What verification finds for one seed.

    `problems` refuse the submission, `notes` do not. `exact` of `episodes` are equal bit for bit when played again.
    `result` and `table` are computed from the episodes as they were played again; None if it did not come to that.
    """

    seed: int
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    episodes: int = 0
    exact: int = 0
    result: Result | None = None
    table: pd.DataFrame | None = None

    def add(self, *problems: str) -> None:
        """Adds problems of one kind: the first few, and how many more there are."""
        lines = [f"seed{self.seed}: {problem}" for problem in problems]
        more = [f"seed{self.seed}: and {len(lines) - SHOWN} more of this kind"] if len(lines) > SHOWN else []
        self.problems += lines[:SHOWN] + more


@dataclass(slots=True)
class Verdict:
    """What verification finds for a submission: problems, notes, and the results computed anew, by seed.

    `tables` are the episodes as they were played again.
    """

    manifest: Manifest
    tier: str = "replayed"
    episodes: int = 0
    exact: int = 0
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    results: dict[int, Result] = field(default_factory=dict)
    tables: dict[int, pd.DataFrame] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """True if verification found no problem."""
        return not self.problems

    def add(self, finding: SeedFinding) -> None:
        """Adds what verification found for a seed."""
        self.problems += finding.problems
        self.notes += finding.notes
        self.episodes += finding.episodes
        self.exact += finding.exact
        if finding.result is not None and finding.table is not None:
            self.results[finding.seed], self.tables[finding.seed] = finding.result, finding.table
