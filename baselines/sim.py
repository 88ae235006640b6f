"""SIM: RLIL in the environment of the paper's earlier study, with simulated trajectories."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from baselines.rlil import Rlil


@dataclass(frozen=True)
class Sim(Rlil):
    """RLIL trained and evaluated on minimum-jerk reaches, not on a track's reaches (paper, fig. 4a, "SIM")."""

    name: ClassVar[str] = "sim"
    train_source: ClassVar[str] = "minjerk"
