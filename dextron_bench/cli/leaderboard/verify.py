"""`dextron-bench leaderboard verify` and `add`: verifies submissions and the leaderboard's own rows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import print_table, progress_bar
from dextron_bench.cli.support.pieces import PieceFlags, Pieces
from dextron_bench.reaches.sources import SourceName
from dextron_bench.storage.printable import printable, printable_line

if TYPE_CHECKING:
    from dextron_bench.submissions.verdict import Verdict


@dataclass(frozen=True)
class Verify:
    """Verify a submission: replay its actions and compare all its claims with the replayed episodes.

    With --all, verify every row of a leaderboard: replay the actions of submissions, and run the baselines again. Only
    this can be done in shares or on a cluster.

    Example: dextron-bench leaderboard verify my-agent-synthetic.zip
    """

    bundle: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="FILE.zip")] = None
    """The submission."""
    all: bool = False
    """Verify the leaderboard's own rows instead of a submission."""
    rows: int = 0
    """With --all: how many rows of each split to verify, drawn at random; 0 means all."""
    method: tuple[str, ...] = ()
    """With --all: only the rows of these methods."""
    reaches: tuple[SourceName, ...] = ()
    """With --all: only rows on these sources; `real` needs the recorded reaches."""
    redraw: bool = False
    """With --all: also draw the fresh settings of every row again from its beacon; this takes minutes for each."""
    stamp: bool = False
    """With --all: give baselines that ran again completely the tier `re-run`, and build the leaderboard."""
    rerun: bool = False
    """Also run the agent of the submission again, in a sandbox, from the files in its bundle."""
    trust: bool = False
    """With --rerun: run the agent even without a sandbox, with all your rights; its tier stays `replayed`."""
    beacon: str = ""
    """With --rerun: a public value that did not exist when the submission was made, from which fresh settings follow;
    by default a random one."""
    fresh_rows: int = 0
    """With --rerun: how many fresh settings of each split its agent plays; 0 means as many as the split has."""
    board: Path = Path("leaderboard")
    """Folder of the leaderboard."""
    pieces: Pieces = field(default_factory=PieceFlags)
    runs: Path = Path("runs")
    """Folder of all runs; the findings of shares are in its folder `verify`."""
    threads: int = 0
    """Threads of the simulation; 0 means one per processor. The results do not depend on it."""
    quiet: bool = False
    """Show no progress."""

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
        with unpacked(self.bundle) as opened:
            return print_verdict(_verify(opened, self))


@dataclass(frozen=True)
class Add:
    """Verify a submission, add it to the leaderboard, and build the tables and the page again.

    Example: dextron-bench leaderboard add my-agent-synthetic.zip
    """

    bundle: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE.zip")]
    """The submission."""
    rerun: bool = False
    """Also run its agent again, in a sandbox; the tier of its row is then `re-run` instead of `replayed`."""
    trust: bool = False
    """With --rerun: run the agent even without a sandbox, with all your rights; its tier stays `replayed`."""
    beacon: str = ""
    """With --rerun: a public value that did not exist when the submission was made, from which fresh settings follow;
    by default a random one."""
    fresh_rows: int = 0
    """With --rerun: how many fresh settings of each split its agent plays; 0 means as many as the split has."""
    replace: bool = False
    """Replace a submission of the same name."""
    board: Path = Path("leaderboard")
    """Folder of the leaderboard."""
    threads: int = 0
    """Threads of the simulation; 0 means one per processor. The results do not depend on it."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import add
        from dextron_bench.submissions.bundle import AGENT

        with unpacked(self.bundle) as opened:
            folder, manifest = opened
            add.check_name(manifest["name"], manifest["reaches"], self.board, self.replace)
            verdict = _verify(opened, self)
            code = print_verdict(verdict)
            if verdict.passed:
                print(*add.merge(verdict, self.board, folder / AGENT), sep="\n")
        return code


@contextmanager
def unpacked(file: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Unpacks a bundle into a temporary folder; yields the folder and the manifest."""
    from dextron_bench.submissions import bundle as submission_bundle

    with TemporaryDirectory(prefix="dextron-bundle-") as folder:
        yield Path(folder), submission_bundle.unpack(file, Path(folder))


def _verify(opened: tuple[Path, dict[str, Any]], flags: Verify | Add) -> Verdict:
    from dextron_bench.splits.fresh_settings import FreshSettings
    from dextron_bench.storage import hashing
    from dextron_bench.submissions import verification
    from dextron_bench.submissions.seed_check import Playing

    assert flags.bundle is not None
    drawn = {"submission": hashing.sha256(flags.bundle), "rows": flags.fresh_rows}
    fresh = FreshSettings(**drawn, beacon=flags.beacon) if flags.beacon else FreshSettings(**drawn)
    with progress_bar("verifying", flags.quiet) as progress:
        how = Playing(trust=flags.trust, threads=flags.threads, report=progress)
        return verification.verify(*opened, flags.board, how, flags.rerun, fresh)


def print_verdict(verdict: Verdict) -> int:
    """Prints the result of a verification and returns the exit code."""
    name = f"{verdict.manifest['name']} on {verdict.manifest['reaches']} reaches"
    for note in verdict.notes:
        print(printable_line(f"note: {note}"))
    if verdict.passed:
        print(f"{name}: {verdict.tier}; {verdict.exact} of {verdict.episodes} episodes equal bit for bit")
        print_fresh(verdict)
        return DONE
    print(f"{name}: refused", *map(printable_line, verdict.problems), sep="\n  ")
    return DIFFERS


def print_fresh(verdict: Verdict) -> None:
    """Prints what the agent scored on fresh settings, beside its scores on the splits, if it played any."""
    from dextron_bench.scores import cells, standings

    rows = standings.table(verdict.results.values())
    if not rows["fresh"].notna().any():
        return
    beacon = next(iter(verdict.results.values()))["fresh"]["beacon"]
    lines = [
        [
            row["split"],
            cells.mean_return(row),
            cells.fresh(row),
            cells.gap(row),
            "beyond noise" if row["marked"] else "",
        ]
        for row in rows.to_dict("records")
    ]
    print_table(f"fresh settings, beacon {printable(beacon)}", ["split", "return", "fresh", "gap", ""], lines)
