"""`leaderboard verify --all`: verifies the rows of a board, all at once or in shares, and prints what it finds."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import progress_bar
from dextron_bench.leaderboard import board_rows, build, round_check, rounds
from dextron_bench.leaderboard import verify_board as board
from dextron_bench.leaderboard.row_checks import RowChecks
from dextron_bench.storage.printable import printable_line

if TYPE_CHECKING:
    from dextron_bench.cli.support.verification_flags import BoardFlags

SHOWN = 5  # How many problems of a row are printed.


def verify_board(flags: BoardFlags) -> int:
    """Verifies every row, or a share of them, or with --merge takes the findings of shares; returns the exit code.

    Prints what is found, save for a share, whose findings are stored.
    """
    rows = board_rows.rows(flags.board, flags.method, flags.reaches)
    checks = RowChecks(flags.runs / "verify", flags.board, rows, flags.rows, flags.threads)
    if flags.pieces.play(lambda: [checks], flags.runs, flags.threads, flags.quiet):
        return DONE
    sound = True
    for row, finding in checks.findings(functools.partial(progress_bar, quiet=flags.quiet)):
        done = finding.done if not finding.problems else "DIFFERS from its episodes"
        print(printable_line(f"{row.name}: {done}"), flush=True)
        for problem in finding.problems[:SHOWN]:
            print(f"  {printable_line(problem)}")
        sound &= not finding.problems
        if flags.stamp and board.stamp(row, finding):
            print("  its tier is now `re-run`")
    if flags.stamp:
        build.build(flags.board)
    sound &= _verify_round(flags)
    if problems := board.differing_files(flags.board):
        print("tables and page: DIFFER from the results", *problems, sep="\n  ")
    else:
        print("tables and page: equal to those computed again from the results")
    return DONE if sound and not problems else DIFFERS


def _verify_round(flags: BoardFlags) -> bool:
    """Verifies the files of the latest round, and prints what is found; True if they are sound."""
    if (latest := rounds.latest(flags.board)) is None:
        return True
    with progress_bar(f"round {latest.number}", flags.quiet) as progress:
        problems = round_check.problems(latest, flags.redraw, flags.threads, progress)
    verdict = "its files contradict each other" if problems else "its files agree"
    print(f"round {latest.number}: {verdict}", *map(printable_line, problems), sep="\n  ")
    return not problems
