"""`dextron-bench leaderboard verify`: verifies submissions and the leaderboard's own rows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dextron_bench.cli.support import verdicts
from dextron_bench.cli.support.verification_flags import BoardFlags


@dataclass(frozen=True)
class Verify(BoardFlags):
    """Verify a submission: replay its actions and compare all its claims with the replayed episodes.

    With --all, verify every row of a leaderboard: replay the actions of submissions, and run the baselines again.
    Only with --all, the work has pieces, one for each row, for --share, --merge and --cluster.

    Example: dextron-bench leaderboard verify my-agent-synthetic.zip
    """

    bundle: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="FILE.zip")] = None
    """The submission."""
    all: bool = False
    """Verify the leaderboard's own rows instead of a submission."""

    def __call__(self) -> int:
        from dextron_bench.cli.leaderboard import board_verification
        from dextron_bench.leaderboard import verify_board
        from dextron_bench.storage.shares import BadShare

        self.pieces.check()
        if self.all and self.bundle is not None:
            raise verify_board.NothingToVerify(
                f"--all verifies the leaderboard's own rows: leave out {self.bundle}, or leave out --all"
            )
        if not self.all and self.bundle is None:
            raise verify_board.NothingToVerify("give a submission, or --all for the leaderboard's own rows")
        if self.bundle is not None and self.pieces.given:
            raise BadShare("--share, --merge and --cluster need --all: the verification of a submission is one piece")
        if self.bundle is None:
            return board_verification.verify_board(self)
        with verdicts.unpacked(self.bundle) as opened:
            return verdicts.print_verdict(self.verdict(self.bundle, opened))
