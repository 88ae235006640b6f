"""`leaderboard verify --all`: verifies the rows of a board, all at once or in shares, and prints what it finds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dextron_bench.cli.support import pieces as piece_flags
from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import progress_bar
from dextron_bench.leaderboard import build, finding_pieces
from dextron_bench.leaderboard import verify_board as board
from dextron_bench.leaderboard.baseline_check import Finding
from dextron_bench.leaderboard.finding_pieces import FindingPieces
from dextron_bench.leaderboard.verify_board import Row
from dextron_bench.storage.printable import printable_line
from dextron_bench.storage.shares import Share, check_complete

if TYPE_CHECKING:
    from dextron_bench.cli.support.verification_flags import BoardFlags

SHOWN = 5  # How many problems of a row are printed.


def verify_share(flags: BoardFlags, share: Share) -> int:
    """Verifies the rows of a share and stores what it finds; returns the exit code."""
    pieces, rows = _pieces(flags), board.rows(flags.board, flags.method, flags.reaches)
    mine = [row for place, row in enumerate(rows) if share.has(place)]
    stored = pieces.read(rows)
    for row in mine:
        if row.run.identity not in stored:
            pieces.write(row, _check(flags, row))
    return piece_flags.print_done(share, f"{len(mine)} of {len(rows)} rows", pieces.folder)


def verify_board(flags: BoardFlags) -> int:
    """Verifies every row, or with --merge takes the findings of shares, and prints them; returns the exit code."""
    sound, pieces = True, _pieces(flags)
    rows = board.rows(flags.board, flags.method, flags.reaches)
    if flags.pieces.cluster:
        _check_on_cluster(flags, pieces, rows)
    stored = pieces.read(rows)
    if flags.pieces.merge:
        check_complete("the merge", [row.run.identity for row in rows], stored)
    findings = {name: finding_pieces.finding_of(piece) for name, piece in stored.items()}
    for row in rows:
        finding = findings.get(row.run.identity) or _check(flags, row)
        done = finding.done if not finding.problems else "DIFFERS from its episodes"
        print(printable_line(f"{row.name}: {done}"), flush=True)
        for problem in finding.problems[:SHOWN]:
            print(f"  {printable_line(problem)}")
        sound &= not finding.problems
        if flags.stamp and board.stamp(row, finding):
            print("  its tier is now `re-run`")
    pieces.remove(stored.values())
    if flags.stamp:
        build.build(flags.board)
    if problems := board.differing_files(flags.board):
        print("tables and page: DIFFER from the results", *problems, sep="\n  ")
    else:
        print("tables and page: equal to those computed again from the results")
    return DONE if sound and not problems else DIFFERS


def _check_on_cluster(flags: BoardFlags, pieces: FindingPieces, rows: list[Row]) -> None:
    from dextron_bench.cluster import verifications

    with (
        piece_flags.connected(flags.pieces.cluster, flags.runs, flags.threads) as cluster,
        progress_bar("rows", flags.quiet) as progress,
    ):
        verifications.check(cluster, pieces, rows, flags.runs, progress)


def _check(flags: BoardFlags, row: Row) -> Finding:
    with progress_bar(row.name, flags.quiet) as progress:
        return board.check(row, flags.board, flags.rows, flags.redraw, flags.threads, progress)


def _pieces(flags: BoardFlags) -> FindingPieces:
    return FindingPieces(flags.runs / "verify", flags.board, {"rows": flags.rows, "redraw": flags.redraw})
