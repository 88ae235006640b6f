"""`dextron-bench leaderboard round`: the announced rows play settings that nobody could know, and get their ranks."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import progress_bar
from dextron_bench.cli.support.pieces import PieceFlags, Pieces
from dextron_bench.cli.support.standings import print_ranks

if TYPE_CHECKING:
    from dextron_bench.leaderboard import rounds


@dataclass(frozen=True)
class Round:
    """Play the round that was announced: draw its settings, let every row play them, and build the leaderboard.

    It takes hours. If it is interrupted, the same command continues.

    Example: dextron-bench leaderboard round --value 8f1c2d
    """

    value: str = ""
    """The value of the beacon that was announced; only until the settings are drawn."""
    void: str = ""
    """Do not play: say why the round does not count."""
    pieces: Pieces = field(default_factory=PieceFlags)
    board: flags.Board = flags.BOARD
    runs: Path = Path("runs")
    """Folder of all runs; the episodes of shares are in its folder `rounds`."""
    threads: flags.Threads = 0
    quiet: flags.Quiet = False

    def __call__(self) -> int:
        from dextron_bench.leaderboard import build, round_table, round_work, rounds

        self.pieces.check()
        current = rounds.current(self.board)
        if self.void:
            rounds.declare_void(current, self.void)
        else:
            self._draw(current)
            work = round_work.work(current, self.runs, self.threads)
            if self.pieces.play(lambda: [work], self.runs, self.threads, self.quiet):
                return DONE
            for name in [name for name in work.names() if name not in work.done()]:
                with progress_bar(work.title(name), self.quiet) as progress:
                    work.play(name, progress)
            work.finish()
        print(*build.build(self.board), sep="\n")
        print_ranks(round_table.table(self.board))
        return DONE

    def _draw(self, current: rounds.Round) -> None:
        """Draws the settings, if they are not drawn yet."""
        from dextron_bench.errors import BadInput
        from dextron_bench.leaderboard import rounds

        if current.draw_file.exists():
            return
        if not self.value:
            raise BadInput(f"round {current.number} needs the value of its beacon: {current.commitments.beacon}")
        with progress_bar(f"round {current.number}", self.quiet) as progress:
            rounds.draw(current, self.value, self.threads, progress)
