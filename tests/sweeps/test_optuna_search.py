"""Optuna: a proposal depends on the earlier trials alone, and a curve below the median stops."""

from __future__ import annotations

import pytest

pytest.importorskip("optuna")

from dextron_bench.scores.statistics import Estimate
from dextron_bench.sweeps import optuna_search
from dextron_bench.sweeps.space import Choices, Range
from dextron_bench.sweeps.trial import DONE, FAILED, STOPPED, Trial

SPACE = {"rate": Range(1e-4, 1.0, log=True), "hold": Range(1, 40), "layers": Choices(((64, 64), (32,)))}


def done(rate: float, score: float, *points: float) -> Trial:
    curve = {10 * (index + 1): point for index, point in enumerate(points)}
    settings = {"rate": rate, "hold": 3, "layers": [32]}
    return Trial(settings, "mine/synthetic", DONE, Estimate(score, score, score), points=curve)


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["tpe", "gp"])
def test_a_proposal_depends_on_the_earlier_trials_and_the_seed_alone(sampler: str):
    earlier = [done(0.1 / (k + 1), 10.0 - k) for k in range(11)]
    earlier += [Trial(earlier[0].settings, state=FAILED), Trial(earlier[1].settings, state=STOPPED, points={10: 1.0})]
    first, again, other = (optuna_search.propose(SPACE, sampler, [seed, 13], earlier) for seed in (0, 0, 1))
    assert first == again != other
    assert 1e-4 <= first["rate"] <= 1.0
    assert isinstance(first["hold"], int)
    assert first["layers"] in ((64, 64), (32,))


def test_the_samplers_learn_from_earlier_trials():
    space = {"rate": Range(0.0, 1.0)}
    good = [Trial({"rate": k / 20}, "", DONE, Estimate(-abs(k / 20 - 0.2), 0, 0)) for k in range(21)]
    draws = [optuna_search.propose(space, "tpe", [seed], good)["rate"] for seed in range(20)]
    assert sum(abs(rate - 0.2) < 0.2 for rate in draws) > 15


def test_a_trial_stops_below_the_median_of_five():
    four = [done(0.1, 10.0, *curve) for curve in ((1, 8), (2, 9), (3, 10), (4, 11))]
    five = [*four, done(0.1, 10.0, 5, 12)]
    assert not optuna_search.should_stop({10: 0.0}, four)  # Too few to compare with.
    assert optuna_search.should_stop({10: 2.9}, five)
    assert not optuna_search.should_stop({10: 3.0}, five)
    assert optuna_search.should_stop({10: 5.0, 20: 6.0}, five)
    assert not optuna_search.should_stop({10: 5.0, 30: 0.0}, five)  # No other curve has this epoch.
    assert not optuna_search.should_stop({}, five)
