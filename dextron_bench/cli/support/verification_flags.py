"""The flags with which submissions and a leaderboard's own rows are verified."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.output import progress_bar
from dextron_bench.cli.support.pieces import PieceFlags, Pieces
from dextron_bench.reaches.sources import SourceName

if TYPE_CHECKING:
    from dextron_bench.submissions.manifest import Manifest
    from dextron_bench.submissions.verdict import Verdict


@dataclass(frozen=True)
class SubmissionFlags:
    """Flags that say how a submission is verified."""

    rerun: bool = False
    """Also run the agent of the submission again, in a sandbox, from the files in its bundle."""
    trust: bool = False
    """With --rerun: run the agent even without a sandbox, with all your rights; its tier stays `replayed`."""
    board: flags.Board = flags.BOARD
    threads: flags.Threads = 0
    quiet: flags.Quiet = False

    def verdict(self, bundle: Path, opened: tuple[Path, Manifest]) -> Verdict:
        """Verifies a bundle that is unpacked into a folder, with its manifest."""
        from dextron_bench.submissions import verification
        from dextron_bench.submissions.seed_check import Playing

        with progress_bar("verifying", self.quiet) as progress:
            how = Playing(trust=self.trust, threads=self.threads, report=progress)
            return verification.verify(*opened, self.board, how, self.rerun)


@dataclass(frozen=True)
class BoardFlags(SubmissionFlags):
    """Flags that say which rows of a leaderboard are verified, and how; also those for a submission."""

    rows: int = 0
    """With --all: how many rows of each split to verify, drawn at random; 0 means all."""
    method: tuple[str, ...] = ()
    """With --all: only the rows of these methods."""
    reaches: tuple[SourceName, ...] = ()
    """With --all: only rows on these sources; `real` needs the recorded reaches."""
    redraw: bool = False
    """With --all: also draw the settings of the latest round again from its beacon; this takes an hour."""
    stamp: bool = False
    """With --all: give baselines that ran again completely the tier `re-run`, and build the leaderboard."""
    pieces: Pieces = field(default_factory=PieceFlags)
    runs: Path = Path("runs")
    """Folder of all runs; the findings of shares are in its folder `verify`."""
