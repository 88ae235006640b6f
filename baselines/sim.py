"""SIM: RLIL where the paper's earlier study trained, in the simulated-trajectory world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from baselines.rlil import Rlil


@dataclass(frozen=True)
class Sim(Rlil):
    """RLIL trained and evaluated on minimum-jerk reaches: no entrant of the tracks (paper, fig. 4a, "SIM")."""

    name: ClassVar[str] = "sim"
    train_source: ClassVar[str] = "minjerk"
