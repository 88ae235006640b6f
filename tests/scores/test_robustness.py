"""Losses under tracks and the area over delays, by hand."""

from __future__ import annotations

import math

import pytest

from dextron_bench.evaluation.results import Result
from dextron_bench.scores import robustness
from tests.helpers import results


def result(method: str, seed: int = 0, **scores: list[float]) -> Result:
    """A result with the scores of splits, whose names have `_` for `+` and `-`."""
    names = {"test": "test", "delay40": "test+delay-40", "noisy": "test+sensing-1", "hard": "hard"}
    splits = {names[name]: {"scores": values} for name, values in scores.items()}
    return results.result(method, seed, splits=splits)


def test_losses_are_paired_by_setting_and_seed():
    """Both settings lose exactly 3, so the interval has no width although the returns differ."""
    rows = robustness.table([result("a", test=[20.0, 8.0], delay40=[17.0, 5.0]), result("b", test=[1.0, 2.0])])
    [row] = rows
    assert (row.method, row.plain, row.returns) == ("a", 14.0, {"delay-40": 11.0})
    loss = row.losses["delay-40"]
    assert (loss.mean, loss.low, loss.high) == (3.0, 3.0, 3.0)
    assert math.isnan(row.area)


def test_only_seeds_that_played_both_are_compared():
    seeds = [
        result("a", 0, test=[20.0], noisy=[10.0]),
        result("a", 1, test=[0.0], noisy=[0.0]),
        result("a", 2, test=[5.0]),
    ]
    [row] = robustness.table(seeds)
    assert (row.seeds, row.plain, row.returns["sensing-1"], row.losses["sensing-1"].mean) == (2, 10.0, 5.0, 5.0)


def test_the_area_over_delays_by_hand():
    """20 until 100 ms, then down to 0 at 200 ms and after: (100 + 50) / 300 of the full height."""
    returns = {"delay-40": 20.0, "delay-100": 20.0, "delay-200": 0.0, "delay-300": 0.0}
    assert robustness.area(20.0, returns) == pytest.approx(0.5)
    assert robustness.area(20.0, dict.fromkeys(returns, 20.0)) == pytest.approx(1.0)
    assert math.isnan(robustness.area(20.0, {"delay-40": 20.0}))


def test_the_best_area_comes_first_then_the_best_plain_return():
    rows = [result("low", test=[1.0], delay40=[1.0]), result("high", test=[9.0], delay40=[0.0])]
    assert [row.method for row in robustness.table(rows)] == ["high", "low"]
