"""RLIL: soft actor-critic with a share of expert transitions in every batch (paper, II.D)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from baselines.rl import Rl
from baselines.sac import BATCH


class BadShare(ValueError):
    """A demo-use ratio outside [0, 1]."""


@dataclass(frozen=True)
class Rlil(Rl):
    """SAC guided by demonstrations, a share of each batch (paper, fig. 4a, "RLIL 0.1" and "RLIL 0.3")."""

    name: ClassVar[str] = "rlil"

    dur: float = 0.1
    """Demo-use ratio: the share of each batch that experts lived through, 0 to 1."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.dur <= 1.0:
            raise BadShare(f"--dur is {self.dur:g}; a demo-use ratio lies between 0 and 1")

    @property
    def stem(self) -> str:
        """Tells demo-use ratios apart, as "rlil-0.1" does."""
        return f"{self.name}-{self.dur:g}"

    @property
    def demonstrated(self) -> int:
        """Expert transitions in each batch: int(DUR x 32), as the paper's code has it."""
        return int(self.dur * BATCH)
