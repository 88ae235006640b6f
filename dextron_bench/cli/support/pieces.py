"""The flags `--share`, `--merge` and `--cluster` of commands whose work has many pieces (docs/many-machines.md)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_warning, progress_bar
from dextron_bench.storage import shares

if TYPE_CHECKING:
    from dextron_bench.cluster.ray_cluster import RayCluster
    from dextron_bench.runs.evaluation_job import EvaluationJob

ClusterFlag = Annotated[str, tyro.conf.arg(metavar="local|auto|ray://HOST:PORT")]


@dataclass(frozen=True)
class Shares:
    """Which part of the work a command does; without its flags, all of it."""

    share: Annotated[str, tyro.conf.arg(metavar="I/N")] = ""
    """Do only a part of the work: 0/2 and 1/2 are its halves, on one machine or on two (docs/many-machines.md)."""
    merge: bool = False
    """Only put together what shares have done; if anything is missing, this is an error that names it."""

    def parsed(self) -> shares.Share | None:
        """The share of the flags; None if there is none. Raises BadShare."""
        if self.share and self.merge:
            raise shares.BadShare(
                "--share does a part of the pieces and --merge puts all of them together: give one of both"
            )
        return shares.Share.parse(self.share) if self.share else None


@dataclass(frozen=True)
class Pieces(Shares):
    """Which part of the work a command does, and where; without its flags, all of it in this process."""

    cluster: ClusterFlag = ""
    """Do the work on a cluster with Ray: on this machine, on the cluster it belongs to, or on another one."""

    def parsed(self) -> shares.Share | None:
        """The share of the flags; None if there is none. Raises BadShare, BadCluster."""
        check_cluster(self.cluster)
        if self.cluster and (self.share or self.merge):
            from dextron_bench.cluster.tasks import BadCluster

            raise BadCluster(
                "--cluster does all pieces and puts them together: leave out --share and --merge, or leave out "
                "--cluster"
            )
        return super().parsed()


def check_cluster(cluster: str) -> None:
    """Raises BadCluster if a text names no cluster; no cluster at all is fine."""
    if cluster:
        from dextron_bench.cluster import ray_cluster

        ray_cluster.check_flag(cluster)


@contextmanager
def connected(address: str, runs: Path, threads: int) -> Iterator[RayCluster]:
    """A connection to the cluster of the flag; says at the end on stderr how many pieces lost their node."""
    from dextron_bench.cluster.ray_cluster import RayCluster

    with RayCluster(address, runs, threads) as cluster:
        yield cluster
    if cluster.losses:
        print_warning(f"pieces done again because their node was lost: {cluster.losses}")


def play_jobs(jobs: Sequence[EvaluationJob], share: shares.Share, folder: Path, quiet: bool) -> int:
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
    shares.check_complete("the merge", names, present)


def print_done(share: shares.Share, what: str, folder: Path) -> int:
    """Prints that what a share does is done, and what to do then; returns the exit code."""
    print(f"share {share}: its {what} are done, in {folder}")
    print("when all shares are done, put their folders together, and run the same command with --merge")
    return DONE
