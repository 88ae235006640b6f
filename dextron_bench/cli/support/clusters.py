"""The flag `--cluster` of commands whose work has many pieces (docs/many-machines.md)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support.output import print_warning

if TYPE_CHECKING:
    from dextron_bench.cluster.ray_cluster import RayCluster

Flag = Annotated[str, tyro.conf.arg(metavar="local|auto|ray://HOST:PORT")]


def check(cluster: str, share: str = "", merge: bool = False) -> None:
    """Raises BadCluster if the flags name no cluster, or contradict each other; a command without the flag is fine."""
    if not cluster:
        return
    from dextron_bench.cluster import ray_cluster

    ray_cluster.check_flag(cluster)
    if share or merge:
        raise ray_cluster.BadCluster(
            "--cluster does all pieces and puts them together: leave out --share and --merge, or leave out --cluster"
        )


@contextmanager
def connected(address: str, runs: Path, threads: int) -> Iterator[RayCluster]:
    """A connection to the cluster of the flag; says at the end on stderr how many pieces lost their node."""
    from dextron_bench.cluster.ray_cluster import RayCluster

    with RayCluster(address, runs, threads) as cluster:
        yield cluster
    if cluster.losses:
        print_warning(f"pieces done again because their node was lost: {cluster.losses}")
