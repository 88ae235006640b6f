"""`dextron-bench leaderboard fresh`: the baselines of the leaderboard play settings that nobody could know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dextron_bench.cli.support.baseline_flags import BaselineFlags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import progress_bar

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dextron_bench.leaderboard.verify_board import Row


@dataclass(frozen=True)
class Fresh(BaselineFlags):
    """Let the baselines of the leaderboard play fresh settings, the same for all, and build the leaderboard.

    If it is interrupted, the same command continues with the rows that have not played them.

    Example: dextron-bench leaderboard fresh --beacon 2026-11-22
    """

    beacon: str = ""
    """A public value that did not exist when the baselines were trained; by default the board's, or a random one."""
    rows: int = 0
    """How many fresh settings of each split; 0 means as many as the split has."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import build

        for reaches, rows in self.baselines().items():
            self._play(reaches, rows)
        print(*build.build(self.board), sep="\n")
        return DONE

    def _play(self, reaches: str, rows: Sequence[Row]) -> None:
        """Lets the baselines on one source play, one after the other."""
        from dextron_bench.leaderboard import fresh_baselines

        with progress_bar(f"fresh settings of {reaches} reaches", self.quiet) as progress:
            fresh, splits = fresh_baselines.load_or_draw(
                self.board, reaches, self.beacon, self.rows, self.threads, progress
            )
        for row in rows:
            played = row.result.get("fresh", {}).get("splits", {})
            if {name: one["digest"] for name, one in played.items()} != {one.name: one.digest for one in splits}:
                with progress_bar(row.name, self.quiet) as progress:
                    fresh_baselines.play(row.run, row.result, fresh, splits, self.threads, progress)
            print(row.name, flush=True)
