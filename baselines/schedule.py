"""How long the baselines train: presets and their schedules."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self

Preset = Literal["paper", "quick", "tenth", "smoke"]


@dataclass(frozen=True, slots=True)
class Schedule:
    """The length of a training: epochs, frames before the first update, epochs between checkpoints.

    `episodes` is the largest number of expert episodes to learn from; None takes all cases of `train`.
    """

    epochs: int
    warm_start: int
    period: int
    episodes: int | None = None


# `quick` and `tenth` differ from `paper` only in their end: their epochs are the first of `paper`, bit for bit.
SCHEDULES: dict[str, Schedule] = {
    "paper": Schedule(epochs=1000, warm_start=10_000, period=10),
    "quick": Schedule(epochs=200, warm_start=10_000, period=10),
    "tenth": Schedule(epochs=100, warm_start=10_000, period=10),
    "smoke": Schedule(epochs=2, warm_start=1_000, period=1, episodes=50),
}


@dataclass(frozen=True, slots=True)
class Exploration:
    """How an agent explores: control steps for which a noise is held, and the share of later episodes that hold it.

    In the warm start, all episodes hold it. With a hold of 1 the noise is new at each step, as in the paper.
    """

    hold: int = 1
    share: float = 0.0


@dataclass(frozen=True)
class Scheduled:
    """The common settings of the baselines that learn: a preset, which names the run and sets its schedule."""

    name: ClassVar[str]
    train_source: ClassVar[str] = ""

    preset: Preset = "paper"
    """How long to train: 1,000 epochs (paper), 200 (quick), 100 (tenth) or 2 (smoke)."""

    @property
    def label(self) -> str:
        """The method's name with its settings, and its preset if it is not "paper"."""
        return self.stem + ("" if self.preset == "paper" else f"-{self.preset}")

    @property
    def stem(self) -> str:
        """The label without the preset."""
        return self.name

    @property
    def epochs(self) -> int:
        """Number of epochs of the training."""
        return SCHEDULES[self.preset].epochs

    @property
    def period(self) -> int:
        """Epochs between checkpoints."""
        return SCHEDULES[self.preset].period

    @property
    def demonstrated(self) -> int:
        """Number of expert transitions in each batch."""
        return 0

    def demonstrations(self, episodes: int) -> int:
        """Number of expert episodes that the method learns from, if `train` has `episodes` cases."""
        limit = SCHEDULES[self.preset].episodes or episodes
        return min(limit, episodes) if self.demonstrated else 0

    @property
    def timing_run(self) -> Self:
        """The shortest preset: its last epoch makes all updates, like the epochs of the other presets."""
        return replace(self, preset="smoke")
