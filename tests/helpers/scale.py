"""How long many pieces of work take on a cluster: a formula, and a simulation of the driver, nodes and their losses."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Work:
    """Pieces of equal work; a piece takes a processor for `seconds`, and its files have `size` bytes."""

    pieces: int
    seconds: float
    size: float


@dataclass(frozen=True, slots=True)
class Cluster:
    """Nodes, their processors, and what limits them.

    The driver takes `driver` seconds for a task and receives `bandwidth` bytes a second. A node is lost once in
    `lifetime` seconds on average, and `away` seconds later another one takes its place.
    """

    nodes: int
    processors: int = 16
    driver: float = 0.0022
    bandwidth: float = 100e6
    lifetime: float = 24 * 3600.0
    away: float = 60.0

    @property
    def slots(self) -> int:
        """Pieces that can run at once."""
        return self.nodes * self.processors


def limits(work: Work, cluster: Cluster) -> dict[str, float]:
    """Seconds that the work takes at least because of each part of the cluster; the largest is the bottleneck.

    When a node is lost, a processor has half a piece to repeat, and is away for a while.
    """
    lost = (work.seconds / 2 + cluster.away) / cluster.lifetime
    return {
        "processors": work.pieces * work.seconds * (1.0 + lost) / cluster.slots,
        "driver": work.pieces * cluster.driver,
        "network": work.pieces * work.size / cluster.bandwidth,
    }


def expected(work: Work, cluster: Cluster) -> tuple[float, str]:
    """Seconds that the work takes, with one more piece at the end, and its bottleneck."""
    parts = limits(work, cluster)
    bottleneck = max(parts, key=lambda name: parts[name])
    return parts[bottleneck] + work.seconds, bottleneck


def simulated(work: Work, cluster: Cluster, rng: np.random.Generator) -> float:
    """Seconds until all pieces have arrived, one event for each task: the driver serves one task after another.

    Pieces vary by a tenth. A node that is lost loses its pieces, and each of its processors returns after `away`.
    """
    left, arrived, now, free = work.pieces, 0, 0.0, 0.0
    losses = np.cumsum(rng.exponential(cluster.lifetime / cluster.nodes, size=100_000))
    pending = iter(zip(losses, rng.integers(cluster.nodes, size=losses.size), strict=True))
    loss, lost_node = next(pending)
    lost_at = np.full(cluster.nodes, -np.inf)
    durations = iter(())
    events = [(0.0, slot // cluster.processors, -1.0) for slot in range(cluster.slots)]  # When, node, begun.
    while arrived < work.pieces:
        now, node, begun = heapq.heappop(events)
        while loss <= now:
            lost_at[lost_node] = loss
            loss, lost_node = next(pending)
        if begun >= 0.0:
            if begun < lost_at[node]:
                left += 1
                heapq.heappush(events, (max(now, lost_at[node] + cluster.away), node, -1.0))
                continue
            arrived += 1
        if left:
            left -= 1
            free = max(free, now) + max(cluster.driver, work.size / cluster.bandwidth)
            duration = next(durations, None)
            if duration is None:
                durations = iter(rng.normal(work.seconds, work.seconds / 10, size=10_000))
                duration = next(durations)
            heapq.heappush(events, (free + duration, node, free))
    return now
