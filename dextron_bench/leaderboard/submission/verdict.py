"""What checking a submission found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pandas as pd


@dataclass(slots=True)
class Verdict:
    """What checking found: problems that refuse a submission, notes that do not, and results computed anew."""

    manifest: dict[str, Any]
    tier: str = "replayed"
    episodes: int = 0
    exact: int = 0
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    results: dict[int, dict[str, Any]] = field(default_factory=dict)
    tables: dict[int, pd.DataFrame] = field(default_factory=dict)  # Of episodes, as they were played again.

    @property
    def sound(self) -> bool:
        """True where nothing speaks against the submission."""
        return not self.problems
