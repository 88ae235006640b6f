"""How long the baselines train."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self

Preset = Literal["paper", "quick", "smoke"]


@dataclass(frozen=True, slots=True)
class Schedule:
    """How long a training is: epochs, frames before the first update, epochs between checkpoints.

    `episodes` limits the expert episodes that are played to learn from; None plays all of `train`.
    """

    epochs: int
    warm_start: int
    period: int
    episodes: int | None = None


# All of `quick` but its end is that of `paper`: one is the first epochs of the other, bit for bit.
SCHEDULES: dict[str, Schedule] = {
    "paper": Schedule(epochs=1000, warm_start=10_000, period=10),
    "quick": Schedule(epochs=200, warm_start=10_000, period=10),
    "smoke": Schedule(epochs=2, warm_start=1_000, period=1, episodes=50),
}


@dataclass(frozen=True)
class Scheduled:
    """What the baselines that learn have in common: a preset, which names the run and sets its schedule."""

    name: ClassVar[str]
    train_source: ClassVar[str] = ""

    preset: Preset = "paper"
    """How long to train: hours (paper), minutes (quick), seconds (smoke)."""

    @property
    def label(self) -> str:
        """The method's name with its settings, and its preset where that is not the paper's."""
        return self.stem + ("" if self.preset == "paper" else f"-{self.preset}")

    @property
    def stem(self) -> str:
        """The label less the preset."""
        return self.name

    @property
    def epochs(self) -> int:
        """How many there are."""
        return SCHEDULES[self.preset].epochs

    @property
    def period(self) -> int:
        """Epochs between checkpoints."""
        return SCHEDULES[self.preset].period

    @property
    def demonstrated(self) -> int:
        """Expert transitions in each batch."""
        return 0

    def demonstrations(self, episodes: int) -> int:
        """Expert episodes that it learns from, of so many in `train`."""
        least = SCHEDULES[self.preset].episodes or episodes
        return min(least, episodes) if self.demonstrated else 0

    @property
    def timing_run(self) -> Self:
        """The shortest preset: all updates of its last epoch are made, as in those of the others."""
        return replace(self, preset="smoke")
