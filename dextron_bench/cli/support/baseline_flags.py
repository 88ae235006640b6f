"""The flags of the commands in which baselines of the leaderboard play more settings: `fresh` and `tracks`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

from dextron_bench.cli.support import flags
from dextron_bench.reaches.sources import RankedSource

if TYPE_CHECKING:
    from dextron_bench.leaderboard.board_rows import Row


@dataclass(frozen=True)
class BaselineFlags:
    """Flags that select baselines of a leaderboard, and say how they play."""

    method: tuple[str, ...] = ()
    """Only the rows of these methods."""
    reaches: tuple[RankedSource, ...] = get_args(RankedSource)
    """Only rows on these sources; `real` needs the recorded reaches."""
    board: flags.Board = flags.BOARD
    threads: flags.Threads = 0
    quiet: flags.Quiet = False

    def baselines(self) -> dict[str, list[Row]]:
        """The selected rows of baselines, by source; submissions are played by their authors.

        Raises NotFound, DamagedFile.
        """
        from dextron_bench.leaderboard import board_rows

        rows: dict[str, list[Row]] = {}
        for row in board_rows.rows(self.board, self.method, self.reaches):
            if not row.run.episodes.exists():
                rows.setdefault(row.result.reaches, []).append(row)
        return rows
