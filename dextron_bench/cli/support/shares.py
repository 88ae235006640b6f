"""The flags `--share` and `--merge` of commands whose work has many pieces (docs/many-machines.md)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import progress_bar
from dextron_bench.storage.shares import BadShare, Share, check_complete

__all__ = ["BadShare", "Share", "check_complete"]  # Imported to be used as names of this module, too.

if TYPE_CHECKING:
    from dextron_bench.runs.evaluation_job import EvaluationJob


def parse(share: str, merge: bool) -> Share | None:
    """The share of the flags; None if there is none. Raises BadShare."""
    if share and merge:
        raise BadShare("--share does a part of the pieces and --merge puts all of them together: give one of both")
    return Share.parse(share) if share else None


def play_jobs(jobs: Sequence[EvaluationJob], share: Share, folder: Path, quiet: bool) -> int:
    """Plays the pieces of a share of evaluations, and prints how many there are; returns the exit code."""
    from dextron_bench.runs import annotations

    pieces = [(job, piece) for job in jobs for piece in job.pieces()]
    mine = [pair for place, pair in enumerate(pieces) if share.has(place)]
    done = {id(job): job.done() for job in jobs}
    for job, piece in mine:
        if piece.name not in done[id(job)]:
            with (
                annotations.noting_failure([job.folder]),
                progress_bar(f"{job.folder.identity}, {piece.name}", quiet) as progress,
            ):
                job.play_piece(piece, progress)
    return print_done(share, f"{len(mine)} of {len(pieces)} pieces", folder)


def check_jobs(jobs: Iterable[EvaluationJob]) -> None:
    """Raises MissingPieces if a piece of the evaluations is not done."""
    names: list[str] = []
    present: set[str] = set()
    for job in jobs:
        done = job.done()
        named = {piece.name: f"{job.folder.identity}/{piece.name}" for piece in job.pieces()}
        names += named.values()
        present |= {text for name, text in named.items() if name in done}
    check_complete("the merge", names, present)


def print_done(share: Share, what: str, folder: Path) -> int:
    """Prints that what a share does is done, and what to do then; returns the exit code."""
    print(f"share {share}: its {what} are done, in {folder}")
    print("when all shares are done, put their folders together, and run the same command with --merge")
    return DONE
