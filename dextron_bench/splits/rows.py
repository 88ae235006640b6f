"""What is played: cases with the conditions under which they are played, which are never taken apart."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from dextron_bench.errors import NotFound
from dextron_bench.experts.policies import Case
from dextron_bench.splits.tracks import PLAIN, Track
from dextron_bench.world.bottle import Bottle


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Cases in the order in which they are played, on `track`; a whole split or a part of one.

    `bottles` has one for each case, or none if all have the model's.
    """

    cases: tuple[Case, ...]
    track: Track = PLAIN
    bottles: tuple[Bottle, ...] = ()

    def __post_init__(self) -> None:
        if len(self.bottles) not in (0, len(self)):
            raise ValueError(f"{len(self)} cases cannot have {len(self.bottles)} bottles")

    def __len__(self) -> int:
        return len(self.cases)

    def case(self, row: int) -> Case:
        """The case of a row; raises NotFound."""
        if not 0 <= row < len(self):
            raise NotFound(f"there are rows 0 to {len(self) - 1}, not {row}")
        return self.cases[row]

    def rows(self, numbers: Iterable[int]) -> Rows:
        """The rows of these numbers, in their order, under the same conditions; raises NotFound."""
        chosen = list(numbers)
        cases = tuple(self.case(row) for row in chosen)
        return Rows(cases=cases, track=self.track, bottles=tuple(self.bottles[row] for row in chosen if self.bottles))

    def first(self, count: int) -> Rows:
        """The first rows, at most `count`."""
        return self.rows(range(min(count, len(self))))
