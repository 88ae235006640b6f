"""Statistics of a source, with numbers calculated by hand."""

from __future__ import annotations

import numpy as np
import pytest

from dextron_bench.reaches.minjerk import MinjerkSource
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.setting import ReachSource
from dextron_bench.reaches.summary import group_means, path_length, reach_table


def straight(name: str, speed: float, ring: int) -> Reach:
    """A straight reach of 2 s along x at a speed [m/s]."""
    times = np.linspace(0.0, 2.0, 11)
    positions = np.outer(times, [speed, 0.0, 0.0])
    return Reach(name, times, positions, np.tile([1.0, 0.0, 0.0, 0.0], (11, 1)), 1.0, "01", ring, 3)


def test_a_reach_is_measured_before_its_duration_is_scaled():
    table = reach_table(ReachSource("made-up", [straight("a", 0.3, 2)]))
    row = table.to_dict("records")[0]
    assert (row["name"], row["subject"], row["ring"], row["angle"]) == ("a", "01", 2, 3)
    assert (row["duration"], row["length"], row["speed"]) == pytest.approx((2.0, 0.6, 0.3))


def test_means_are_taken_over_the_reaches_of_each_group():
    table = reach_table(ReachSource("made-up", [straight("a", 0.3, 2), straight("b", 0.1, 0), straight("c", 0.5, 2)]))
    means = group_means(table, ["ring"])
    assert means["ring"].tolist() == [0, 2]
    assert means["reaches"].tolist() == [1, 2]
    np.testing.assert_allclose(means["speed"], [0.1, 0.4])
    np.testing.assert_allclose(means["length"], [0.2, 0.8])


@pytest.mark.slow
def test_minjerk_reaches_last_as_long_as_their_episodes():
    table = reach_table(MinjerkSource())
    np.testing.assert_allclose(table["duration"], 416 * 0.02)
    assert len(table) == 1000


def test_the_length_is_the_sum_of_the_segments():
    assert path_length(np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 2.0]])) == 7.0
