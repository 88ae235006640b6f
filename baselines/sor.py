"""SOR: plays SIM's policy on the reaches of the track; it trains nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from baselines.schedule import Scheduled
from baselines.sim import Sim


@dataclass(frozen=True)
class Sor(Scheduled):
    """SIM's policy on other reaches (paper, fig. 4a, "SOR")."""

    name: ClassVar[str] = "sor"

    @property
    def source_policy(self) -> Sim:
        """SIM with the same preset."""
        return Sim(preset=self.preset)
