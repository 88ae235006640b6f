"""`dextron-bench leaderboard announce`: fixes what will play the next round."""

from __future__ import annotations

from dataclasses import dataclass

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE


@dataclass(frozen=True)
class Announce:
    """Announce the next round of a leaderboard: write the hashes of all rows that will play, before settings exist.

    Example: dextron-bench leaderboard announce --beacon "drand, round 5000000"
    """

    beacon: str = ""
    """A public value of the future, in words; by default a secret, which is printed for `leaderboard round --value`."""
    rows: int = 500
    """Settings of each split, 500 or more."""
    board: flags.Board = flags.BOARD

    def __call__(self) -> int:
        from dextron_bench.leaderboard import rounds

        announced, secret = rounds.announce(self.board, self.beacon, self.rows)
        print(announced.commitments_file)
        print(f"round {announced.number}: {len(announced.commitments.entries)} entries; publish this file now")
        if secret:
            print(f"keep this value secret until then: {secret}")
        return DONE
