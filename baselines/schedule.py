"""How long the baselines train."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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


SCHEDULES: dict[str, Schedule] = {
    "paper": Schedule(epochs=1000, warm_start=10_000, period=10),
    "quick": Schedule(epochs=30, warm_start=3_000, period=5, episodes=500),
    "smoke": Schedule(epochs=2, warm_start=1_500, period=1, episodes=50),
}


def suffix(preset: Preset) -> str:
    """What a preset adds to a method's label; the paper's adds nothing."""
    return "" if preset == "paper" else f"-{preset}"
