"""RLIL: soft actor-critic with a share of expert transitions in every batch (paper, II.D)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from baselines.rl import Rl
from baselines.sac import BATCH


class BadRatio(ValueError):
    """A demo-use ratio outside [0, 1]."""


@dataclass(frozen=True)
class Rlil(Rl):
    """SAC with a share of demonstrations in each batch (paper, fig. 4a, "RLIL 0.1" and "RLIL 0.3")."""

    name: ClassVar[str] = "rlil"

    dur: float = 0.1
    """Demo-use ratio: the share of expert transitions in each batch, 0 to 1."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.dur <= 1.0:
            raise BadRatio(f"--dur is {self.dur:g}; a demo-use ratio lies between 0 and 1")

    @property
    def method_stem(self) -> str:
        """The name with the demo-use ratio, such as "rlil-0.1"."""
        return f"{self.name}-{str(self.dur).removesuffix('.0')}"

    @property
    def demonstrated(self) -> int:
        """Expert transitions in each batch: int(DUR x 32), as in the paper's code."""
        return int(self.dur * BATCH)
