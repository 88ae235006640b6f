"""The flags `--share`, `--merge` and `--cluster` of commands whose work has many pieces (docs/many-machines.md)."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support.output import print_warning, progress_bar

if TYPE_CHECKING:
    from dextron_bench.cluster.ray_cluster import RayCluster
    from dextron_bench.storage.block_work import BlockWork
    from dextron_bench.storage.pieces import ListedWork

Cluster = Annotated[str, tyro.conf.arg(metavar="local|auto|ray://HOST:PORT")]


@dataclass(frozen=True)
class PieceFlags:
    """Which processes do the pieces of a command's work."""

    share: Annotated[str, tyro.conf.arg(metavar="I/N")] = ""
    """Do only a part of the work: 0/2 and 1/2 are its halves, on one machine or on two (docs/many-machines.md)."""
    merge: bool = False
    """Only put together what shares have done; if anything is missing, this is an error that names it."""
    cluster: Cluster = ""
    """Do the work on a cluster with Ray: on this machine, on the cluster it belongs to, or on another one."""

    @property
    def given(self) -> bool:
        """True if one of the flags is given."""
        return bool(self.share or self.merge or self.cluster)

    def check(self) -> None:
        """Raises BadShare and BadCluster if the flags name no share or no cluster, or contradict each other."""
        from dextron_bench.storage.shares import BadShare, Share

        check_cluster(self.cluster)
        if self.cluster and (self.share or self.merge):
            raise BadShare(
                "--cluster does all pieces and puts them together: leave out --share and --merge, or leave out "
                "--cluster"
            )
        if self.share and self.merge:
            raise BadShare("--share does a part of the pieces and --merge puts all of them together: give one of both")
        if self.share:
            Share.parse(self.share)

    def play(self, works: Callable[[], Sequence[ListedWork]], runs: Path, threads: int, quiet: bool) -> bool:
        """Plays what the flags ask for of works below a folder of runs; True if this was a share, which ends there.

        Raises MissingPieces if pieces are missing for a merge, and the errors of the works.
        """
        from dextron_bench.storage import shares

        if self.share:
            share = shares.Share.parse(self.share)
            _print_done(share, shares.play(works(), share, functools.partial(progress_bar, quiet=quiet)), runs)
        if self.merge:
            shares.check(works())
        if self.cluster:
            with connected(self.cluster, runs, threads) as cluster:
                play_on(cluster, works(), quiet)
        return bool(self.share)

    def play_blocks(self, work: BlockWork, runs: Path, threads: int, quiet: bool) -> bool:
        """Plays what the flags ask for of work whose pieces are blocks; as `play`."""
        from dextron_bench.storage.shares import Share

        if self.share:
            share = Share.parse(self.share)
            with progress_bar(f"blocks of share {share}", quiet) as progress:
                _print_done(share, work.play_share(share, progress), work.place)
        if self.merge:
            work.check_complete()
        if self.cluster:
            from dextron_bench.cluster import pieces

            with connected(self.cluster, runs, threads) as cluster, progress_bar(work.unit, quiet) as progress:
                pieces.play_blocks(cluster, work, progress)
        return bool(self.share)


Pieces = Annotated[PieceFlags, tyro.conf.arg(name="")]  # The type of a field whose flags have no prefix.


def check_cluster(cluster: str) -> None:
    """Raises BadCluster if a flag names no cluster, or if Ray is not installed; a command without the flag is fine."""
    if cluster:
        from dextron_bench.cluster import ray_cluster

        ray_cluster.check_flag(cluster)


@contextmanager
def connected(address: str, runs: Path, threads: int) -> Iterator[RayCluster]:
    """A connection to the cluster of a flag; says at the end on stderr how many pieces lost their node."""
    from dextron_bench.cluster.ray_cluster import RayCluster

    with RayCluster(address, runs, threads) as cluster:
        yield cluster
    if cluster.losses:
        print_warning(f"pieces done again because their node was lost: {cluster.losses}")


def play_on(cluster: RayCluster, works: Sequence[ListedWork], quiet: bool) -> None:
    """Plays the pieces that works lack on a cluster."""
    from dextron_bench.cluster import pieces

    with progress_bar("pieces", quiet) as progress:
        pieces.play(cluster, works, progress)


def _print_done(share: object, what: str, folder: Path) -> None:
    """Prints that what a share does is done, and what to do then."""
    print(f"share {share}: its {what} are done, in {folder}")
    print("when all shares are done, put their folders together, and run the same command with --merge")
