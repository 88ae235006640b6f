"""`dextron-bench leaderboard verify` and `add`: submissions and the board's own rows, checked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

import tyro

from dextron_bench.cli.output import progress_bar

if TYPE_CHECKING:
    from dextron_bench.leaderboard.submission.verdict import Verdict

DONE, DIFFERS = 0, 1
SHOWN = 5  # Problems of a row that are told.


@dataclass(frozen=True)
class Verify:
    """Check a submission: play its actions again and hold all that it says against what happens.

    With --all every row of a leaderboard is checked: submissions by their actions, baselines by running them again.

    Example: dextron-bench leaderboard verify my-agent-synthetic.zip
    """

    bundle: tyro.conf.Positional[Path | None] = None
    """The submission."""
    all: bool = False
    """Check the leaderboard's own rows in place of a submission."""
    rows: int = 0
    """With --all: only so many rows of each split, drawn at random; 0 takes all."""
    method: tuple[str, ...] = ()
    """With --all: only these rows of the table."""
    reaches: tuple[Literal["real", "synthetic", "minjerk"], ...] = ()
    """With --all: only rows on these sources; `real` ones need the recorded reaches."""
    stamp: bool = False
    """With --all: note in the results of baselines that were wholly run again that they were, and build the board."""
    rerun: bool = False
    """Also run the submission's agent again, isolated, from the files in its bundle."""
    board: Path = Path("leaderboard")
    """Folder of the leaderboard."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor. Results do not depend on it."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import verify_board

        if self.all == (self.bundle is not None):
            raise verify_board.NothingToVerify("name a submission, or give --all for the leaderboard's own rows")
        if self.bundle is None:
            return self._board()
        with unpacked(self.bundle) as opened:
            return told(_verified(opened, self.board, self.rerun, self.threads, self.quiet))

    def _board(self) -> int:
        from dextron_bench.leaderboard import build, verify_board

        sound = True
        for row in verify_board.rows(self.board, self.method, self.reaches):
            with progress_bar(row.name, self.quiet) as progress:
                found = verify_board.check(row, self.rows, self.threads, progress)
            print(f"{row.name}: {found.done if not found.problems else 'NOT what its episodes give'}", flush=True)
            for problem in found.problems[:SHOWN]:
                print(f"  {problem}")
            sound &= not found.problems
            if self.stamp and verify_board.stamp(row, found):
                print("  its tier is now `re-run`")
        if self.stamp:
            build.build(self.board)
        if problems := verify_board.differing_files(self.board):
            print("tables and page: NOT what the results give", *problems, sep="\n  ")
        else:
            print("tables and page: computed again from the results, and equal")
        return DONE if sound and not problems else DIFFERS


@dataclass(frozen=True)
class Add:
    """Verify a submission and put it on the leaderboard, whose tables and page are made again.

    Example: dextron-bench leaderboard add my-agent-synthetic.zip
    """

    bundle: tyro.conf.Positional[Path]
    """The submission."""
    rerun: bool = False
    """Also run its agent again, isolated: the tier of its row is then `re-run`, else `replayed`."""
    replace: bool = False
    """Put it in place of a submission of the same name."""
    board: Path = Path("leaderboard")
    """Folder of the leaderboard."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor. Results do not depend on it."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import add

        with unpacked(self.bundle) as opened:
            manifest = opened[1]
            add.check_name(manifest["name"], manifest["reaches"], self.board, self.replace)
            verdict = _verified(opened, self.board, self.rerun, self.threads, self.quiet)
            code = told(verdict)
            if verdict.sound:
                print(*add.merge(verdict, self.board), sep="\n")
        return code


@contextmanager
def unpacked(file: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """A bundle's folder and manifest, while they are needed."""
    from dextron_bench.leaderboard.submission import bundle as submission_bundle

    with TemporaryDirectory(prefix="dextron-bundle-") as folder:
        yield Path(folder), submission_bundle.unpack(file, Path(folder))


def _verified(opened: tuple[Path, dict[str, Any]], board: Path, rerun: bool, threads: int, quiet: bool) -> Verdict:
    from dextron_bench.leaderboard.submission import verification

    with progress_bar("verifying", quiet) as progress:
        return verification.verify(*opened, board, rerun, threads, report=progress)


def told(verdict: Verdict) -> int:
    """Prints what verification found; returns the exit code."""
    name = f"{verdict.manifest['name']} on {verdict.manifest['reaches']} reaches"
    for note in verdict.notes:
        print(f"note: {note}")
    if verdict.sound:
        print(f"{name}: {verdict.tier}; {verdict.exact} of {verdict.episodes} episodes equal bit for bit")
        return DONE
    print(f"{name}: refused", *verdict.problems, sep="\n  ")
    return DIFFERS
