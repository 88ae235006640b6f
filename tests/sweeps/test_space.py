"""Spaces: a grid has every combination once, and draws stay in their range."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dextron_bench.errors import BadInput
from dextron_bench.sweeps import space
from dextron_bench.sweeps.space import Choices, Range


def test_a_grid_has_every_combination_in_order():
    parts = {"near": Choices((0.1, 0.2)), "hold": Choices((1, 2, 3))}
    combinations = [(0.1, 1), (0.1, 2), (0.1, 3), (0.2, 1), (0.2, 2), (0.2, 3)]
    assert space.grid(parts) == [{"near": near, "hold": hold} for near, hold in combinations]


@given(st.integers(1, 10**6), st.integers(1, 10**6), st.booleans(), st.booleans(), st.integers(0, 2**32))
def test_a_draw_lies_in_its_range_and_has_its_type(low: int, width: int, whole: bool, log: bool, seed: int):
    scale = 1 if whole else 0.001
    part = Range(low * scale, (low + width) * scale, log)
    number = part.draw(np.random.default_rng(seed))
    assert part.low <= number <= part.high
    assert isinstance(number, int if whole else float)
    json.dumps(number)


def test_both_ends_of_a_range_of_whole_numbers_are_drawn():
    for log in (False, True):
        rng = np.random.default_rng(0)
        assert {Range(1, 3, log).draw(rng) for _ in range(100)} == {1, 2, 3}


def test_a_logarithmic_range_draws_each_power_of_ten_equally_often():
    rng = np.random.default_rng(0)
    draws = np.array([Range(1e-4, 1.0, log=True).draw(rng) for _ in range(4000)])
    counts = np.histogram(np.log10(draws), [-4, -3, -2, -1, 0])[0]
    assert all(abs(counts - 1000) < 120)  # Four standard deviations of a binomial number are 110.


@pytest.mark.parametrize("ends", [(1, 1), (2.0, 1.0), (float("nan"), 1.0), (0.0, float("inf"))])
def test_a_range_needs_two_finite_ends(ends: tuple[float, float]):
    with pytest.raises(BadInput, match="finite ends, the smaller one first"):
        Range(*ends)


def test_a_logarithm_needs_a_positive_range():
    with pytest.raises(BadInput, match="must begin above 0"):
        Range(0.0, 1.0, log=True)


def test_values_of_a_file_get_their_types_back():
    parts = {"layers": Choices(((64, 64), (32,))), "rate": Range(0.1, 0.2)}
    stored = json.loads(json.dumps({"layers": (32,), "rate": 0.15}))
    assert space.restored(parts, stored) == {"layers": (32,), "rate": 0.15}
    with pytest.raises(BadInput, match="none of the values"):
        space.restored(parts, stored | {"layers": [1]})
