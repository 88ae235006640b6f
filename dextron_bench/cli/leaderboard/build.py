"""`dextron-bench leaderboard build`: publishes runs, and builds tables, pictures and page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE


@dataclass(frozen=True)
class Build:
    """Build the tables, pictures and page of the published leaderboard from its results.

    Example: dextron-bench leaderboard build --runs runs --board leaderboard
    """

    runs: Path | None = None
    """A folder of finished runs to publish first: their results, learning curves and weights."""
    board: flags.Board = flags.BOARD

    def __call__(self) -> int:
        from dextron_bench.leaderboard import build, collect

        if self.runs is not None:
            print(*collect.take(self.runs, self.board), sep="\n")
        print(*build.build(self.board), sep="\n")
        return DONE
