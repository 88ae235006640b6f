"""Plans: variances of results made by hand, and the promised power by simulation."""

from __future__ import annotations

import numpy as np
import pytest

from dextron_bench.scores import paired, planning
from dextron_bench.scores.planning import Noise


def scores(rng: np.random.Generator, mean: float, seeds: int, common: np.ndarray, noise: tuple[float, float]):
    """Scores (seeds, settings): a mean, a part of each setting, and normal parts of the seeds and of both."""
    shape = (seeds, len(common))
    return mean + common + noise[0] * rng.normal(size=(seeds, 1)) + noise[1] * rng.normal(size=shape)


def test_the_parts_of_the_noise_are_recovered():
    """Standard deviations 3 of the settings, 2 and 1 of the seeds, 4 and 5 of both."""
    rng, common = np.random.default_rng(0), np.zeros(2000)
    a = scores(rng, 0.0, 40, common, (2.0, 4.0))
    b = scores(rng, 0.0, 40, 3.0 * rng.normal(size=2000), (1.0, 5.0))
    noise = planning.noise(a, b)
    assert noise.settings == pytest.approx(9.0, rel=0.1)
    assert noise.seeds == pytest.approx((4.0, 1.0), rel=0.5)
    assert noise.both == pytest.approx((16.0, 25.0), rel=0.02)


def test_one_seed_each_needs_the_settings_of_the_textbook():
    """A standard deviation of 10 and a difference of 1: (2.8 * 10)^2 = 785 settings, and two more for Student's t."""
    [plan] = planning.plans(Noise(100.0, (), ()), 1.0, [3, 5])
    assert plan.settings
    assert plan == planning.SampleSize(1, plan.settings, 2 * plan.settings)
    assert plan.settings == pytest.approx(787, abs=2)


def test_no_number_of_settings_replaces_seeds():
    """Seeds with a standard deviation of 1 on both sides: three seeds of each show no difference of 1."""
    noise = Noise(100.0, (1.0, 1.0), (50.0, 50.0))
    few, many = planning.plans(noise, 1.0, [3, 30])
    assert (few.settings, few.episodes) == (None, None)
    assert many.settings
    assert many.episodes == 60 * many.settings
    assert planning.detectable(noise, many.settings, 30) <= 1.0 < planning.detectable(noise, many.settings - 1, 30)


def test_a_method_with_one_seed_keeps_it():
    [plan] = planning.plans(Noise(100.0, (0.01,), (50.0,)), 1.0, [5])
    assert plan.settings
    assert plan.episodes == 6 * plan.settings


@pytest.mark.parametrize("seeds", [3, 10])
def test_a_planned_comparison_shows_the_difference_four_times_in_five(seeds: int):
    """With this generator, 77 and 87 % of the comparisons show it; the standard error is 2.8 %."""
    noise, rng = Noise(36.0, (0.04, 0.04), (16.0, 16.0)), np.random.default_rng(5)
    [plan] = planning.plans(noise, 1.0, [seeds])
    assert plan.settings
    shown = []
    for _ in range(200):
        a = scores(rng, 100.0, seeds, np.zeros(plan.settings), (0.2, 4.0))
        b = scores(rng, 101.0, seeds, 6.0 * rng.normal(size=plan.settings), (0.2, 4.0))
        shown.append(paired.difference(a, b, (-1000.0, 1000.0)).low > 0.0)
    assert 0.72 <= np.mean(shown) <= 0.92
