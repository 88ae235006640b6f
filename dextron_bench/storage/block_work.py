"""Work whose pieces are numbered blocks, as many as a goal needs: a search, or a data set.

Nobody knows in advance how many blocks that is, so what shares and a cluster play is estimated from the blocks that are
there.
"""

from __future__ import annotations

import itertools
import math
import statistics
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from dextron_bench.storage import shares
from dextron_bench.storage.folders import visible
from dextron_bench.storage.pieces import FOLDER, Work
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.shares import MissingPieces, Share

BLOCKS = "blocks"  # The folder of the blocks that are no pieces, or no longer.


class BlockWork(Work):
    """Blocks 0, 1, 2 and so on, until they hold `goal` of a `unit` together. A block depends on its number alone."""

    unit: ClassVar[str]
    what: ClassVar[str]  # What it is in a message, such as "the search".
    suffix: ClassVar[str]  # Of the file of a block.
    goal: int

    @property
    def cycle(self) -> int:
        """How many consecutive blocks belong to the same share."""
        return 1

    @abstractmethod
    def begin(self) -> None:
        """Writes what the folder belongs to; raises FolderMismatch if it belongs to other work."""

    @abstractmethod
    def amounts(self) -> Mapping[int, float]:
        """How many units the blocks in the folder hold, those that are pieces too, by number."""

    @abstractmethod
    def play_blocks(self, numbers: Iterable[int]) -> Iterator[list[Path]]:
        """Plays blocks as pieces, and yields the files of each as it ends, the stamp last; may play some ahead."""

    def title(self, name: str) -> str:
        """A block in a message."""
        return f"block {name}"

    def play(self, name: str, report: Progress = no_progress) -> list[Path]:
        """Plays a block as a piece; returns its files, the stamp last."""
        return next(self.play_blocks([int(name)]))

    def block_files(self, pieces: bool = True) -> dict[int, Path]:
        """The files of the blocks in the folder, by number, with those that are pieces only if `pieces`."""
        stamps = visible(self.place / FOLDER, "*.json") if pieces else []
        files = [file.with_suffix(self.suffix) for file in stamps] + visible(self.place / BLOCKS, f"*{self.suffix}")
        return {int(file.stem): file for file in files if file.stem.isdecimal()}

    def block_file(self, number: int) -> Path:
        """The file of a block that is no piece."""
        return self.place / BLOCKS / f"{name_of(number)}{self.suffix}"

    def play_share(self, share: Share, progress: Progress = no_progress) -> str:
        """Plays the blocks of a share until, as far as the folder shows, all shares together reach the goal.

        Returns how many blocks the share has; `progress` receives such numbers. A share that sees only its own blocks
        stops at about its part of the goal (see `blocks_needed`). Raises the errors of `begin` and `stored`.
        """
        self.begin()
        self.stored()  # Checks them.
        first = amounts = self.amounts()
        played = self.play_blocks(number for number in self._numbers(share) if number not in first)
        while not self._is_enough(amounts, share, progress):
            next(played)
            amounts = self.amounts()
        return f"{sum(share.has(number // self.cycle) for number in amounts)} blocks"

    def check_complete(self) -> None:
        """Raises MissingPieces if blocks are missing for the goal, and the errors of `begin` and `stored`."""
        self.begin()
        self.stored()
        amounts = self.amounts()
        if last_needed(amounts, self.goal) is None:
            what, count = f"{self.what} in {self.place}", max(amounts, default=-1) + 1
            titles = [self.title(name_of(number)) for number in range(count)]
            shares.check_complete(what, titles, {self.title(name_of(number)) for number in amounts})
            raise MissingPieces(
                f"{what} lacks the blocks from {name_of(count)} on: the blocks before have {sum(amounts.values())} of "
                f"{self.goal} {self.unit}; run the shares again, or leave out --merge"
            )

    def _numbers(self, share: Share) -> Iterator[int]:
        """The numbers of all blocks of a share, without end."""
        return (number for number in itertools.count() if share.has(number // self.cycle))

    def _is_enough(self, amounts: Mapping[int, float], share: Share, progress: Progress) -> bool:
        """True if a share has nothing left to play; reports its progress."""
        needed = blocks_needed(list(amounts.values()), self.goal)
        following = next(number for number in self._numbers(share) if number not in amounts)
        mine = sum(share.has(number // self.cycle) for number in amounts)
        progress(mine, 0 if needed == math.inf else max(mine, math.ceil(needed / share.of)))
        return last_needed(amounts, self.goal) is not None or following >= needed


def name_of(number: int) -> str:
    """The name of the block with a number."""
    return f"{number:06d}"


def last_needed(amounts: Mapping[int, float], goal: float) -> int | None:
    """The first block up to which blocks 0, 1, ... hold `goal` together; None if they hold less."""
    total = 0.0
    for number in itertools.takewhile(amounts.__contains__, itertools.count()):
        total += amounts[number]
        if total >= goal:
            return number
    return None


def blocks_needed(amounts: Sequence[float], goal: float) -> float:
    """About how many blocks hold `goal` together, from the amounts in some of them; infinite if these are all 0.

    It is more than the mean suggests by two standard errors, so that shares that do not see each other rarely do too
    little.
    """
    total = sum(amounts)
    if total <= 0:
        return math.inf
    error = statistics.pstdev(amounts) / math.sqrt(len(amounts))
    return math.ceil(goal * len(amounts) / total * (1.0 + 2.0 * error * len(amounts) / total))
