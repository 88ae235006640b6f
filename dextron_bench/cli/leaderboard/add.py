"""`dextron-bench leaderboard add`: verifies a submission and adds it to the leaderboard."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dextron_bench.cli.support import verdicts
from dextron_bench.cli.support.verification_flags import SubmissionFlags


@dataclass(frozen=True, kw_only=True)
class Add(SubmissionFlags):
    """Verify a submission, add it to the leaderboard, and build the tables and the page again.

    Example: dextron-bench leaderboard add my-agent-synthetic.zip
    """

    bundle: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE.zip")]
    """The submission."""
    replace: bool = False
    """Replace a submission of the same name."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import add
        from dextron_bench.submissions.bundle import AGENT

        with verdicts.unpacked(self.bundle) as opened:
            folder, manifest = opened
            add.check_name(manifest["name"], manifest["reaches"], self.board, self.replace)
            verdict = self.verdict(self.bundle, opened)
            code = verdicts.print_verdict(verdict)
            if verdict.passed:
                print(*add.merge(verdict, self.board, folder / AGENT), sep="\n")
        return code
