"""The formula for the time of many pieces: by hand, against a simulation, and as the table in the docs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.helpers.scale import Cluster, Work, expected, limits, simulated

DOCS = Path(__file__).parents[2] / "docs/many-machines.md"
EVALUATION, SEARCH = Work(10**6, 12.0, 88e3), Work(10**6, 23.0, 23e3)  # As measured, of a million pieces.
NODES = 10, 100, 1000


def test_limits_by_hand():
    """1,000 pieces of 10 s on 2 x 5 processors take 1,000 s; with losses (5 + 95) / 1,000 more."""
    cluster = Cluster(2, 5, driver=0.5, bandwidth=1e6, lifetime=1000.0, away=95.0)
    times = limits(Work(1000, 10.0, 2e6), cluster)
    assert times == pytest.approx({"processors": 1100.0, "driver": 500.0, "network": 2000.0})
    assert expected(Work(1000, 10.0, 2e6), cluster) == pytest.approx((2010.0, "network"))


@pytest.mark.parametrize("lifetime", [24 * 3600.0, 600.0])
@pytest.mark.parametrize("nodes", [2, 30, 300])
def test_the_formula_agrees_with_the_simulation(nodes: int, lifetime: float):
    work, cluster = Work(100_000, 12.0, 88e3), Cluster(nodes, lifetime=lifetime)
    times = [simulated(work, cluster, np.random.default_rng(seed)) for seed in range(2)]
    assert np.mean(times) == pytest.approx(expected(work, cluster)[0], rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("nodes", NODES)
def test_the_formula_agrees_for_a_million_pieces(nodes: int):
    cluster = Cluster(nodes)
    assert simulated(EVALUATION, cluster, np.random.default_rng(0)) == pytest.approx(
        expected(EVALUATION, cluster)[0], rel=0.02
    )


def test_the_table_in_the_docs_is_the_formula():
    for name, work in (("an evaluation", EVALUATION), ("a search", SEARCH)):
        for nodes in NODES:
            seconds, bottleneck = expected(work, Cluster(nodes))
            line = f"| {name} | {nodes:,} | {seconds / 3600:.1f} h | {bottleneck} |"
            assert line in DOCS.read_text(), line
