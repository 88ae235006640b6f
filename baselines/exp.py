"""EXP: plays each setting's expert. No method can know the expert, so EXP is the ceiling, not an entrant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dextron_bench import ExpertAgent


@dataclass(frozen=True)
class Exp:
    """Replays the expert that solved each setting (paper, fig. 4a, "EXP")."""

    name: ClassVar[str] = "exp"

    def agent(self, seed: int) -> ExpertAgent:
        """The agent, the same for every seed: experts are deterministic."""
        return ExpertAgent()
