"""SOR: SIM's policy on the reaches of the track; it trains nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from baselines.schedule import Preset, suffix
from baselines.sim import Sim


@dataclass(frozen=True)
class Sor:
    """SIM's policy taken to other reaches (paper, fig. 4a, "SOR")."""

    name: ClassVar[str] = "sor"

    preset: Preset = "paper"
    """How long SIM is trained: hours (paper), minutes (quick), seconds (smoke)."""

    @property
    def label(self) -> str:
        """The method's name, and SIM's preset where that is not the paper's."""
        return self.name + suffix(self.preset)

    @property
    def teacher(self) -> Sim:
        """Whose policy it is."""
        return Sim(preset=self.preset)
