"""What a sweep varies: for each setting, a list of values or a range of numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

import numpy as np

from dextron_bench.errors import BadInput

DIGITS = 4  # Of a number that is drawn from a range.


@dataclass(frozen=True, slots=True)
class Choices:
    """A list of values, each as likely as the others."""

    values: tuple[Any, ...]

    def draw(self, rng: np.random.Generator) -> Any:
        """One of the values."""
        return self.values[rng.integers(len(self.values))]

    def index(self, stored: Any) -> int:
        """The place of the value that a JSON file holds, where a tuple is a list; raises BadInput."""
        text = json.dumps(stored)
        for index, value in enumerate(self.values):
            if json.dumps(value) == text:
                return index
        raise BadInput(f"{text} is none of the values")


@dataclass(frozen=True, slots=True)
class Range:
    """Numbers from `low` to `high`, both included; whole numbers if both ends are. Raises BadInput.

    They are uniform, or with `log` their logarithm is.
    """

    low: float
    high: float
    log: bool = False

    def __post_init__(self) -> None:
        if not -np.inf < self.low < self.high < np.inf:
            raise BadInput(f"the range {self.low:g}..{self.high:g} needs finite ends, the smaller one first")
        if self.log and self.low <= 0:
            raise BadInput(f"the range {self.low:g}..{self.high:g}:log must begin above 0")

    @property
    def is_whole(self) -> bool:
        """True for a range of whole numbers."""
        return isinstance(self.low, int) and isinstance(self.high, int)

    def draw(self, rng: np.random.Generator) -> float:
        """A number of the range, with DIGITS digits: readable, and a name of its own for each run."""
        if self.is_whole and not self.log:
            return int(rng.integers(int(self.low), int(self.high), endpoint=True))
        low, high = (self.low - 0.5, self.high + 0.5) if self.is_whole else (self.low, self.high)
        number = float(np.exp(rng.uniform(np.log(low), np.log(high)))) if self.log else float(rng.uniform(low, high))
        number = min(max(float(f"{number:.{DIGITS}g}"), self.low), self.high)  # Rounding may leave the range.
        return round(number) if self.is_whole else number


Space = Mapping[str, Choices | Range]  # By name of the setting.


def grid(space: Mapping[str, Choices]) -> list[dict[str, Any]]:
    """Every combination of values; the last setting changes fastest."""
    return [dict(zip(space, values, strict=True)) for values in product(*(part.values for part in space.values()))]


def draw(space: Space, rng: np.random.Generator) -> dict[str, Any]:
    """A random value of each setting."""
    return {name: part.draw(rng) for name, part in space.items()}


def restored(space: Space, stored: Mapping[str, Any]) -> dict[str, Any]:
    """The settings that a JSON file holds, with the types that they have in the space; raises BadInput."""
    return {
        name: part.values[part.index(stored[name])] if isinstance(part, Choices) else stored[name]
        for name, part in space.items()
    }


def as_json(space: Space) -> dict[str, Any]:
    """A space as plain values."""
    return {name: asdict(part) for name, part in space.items()}
