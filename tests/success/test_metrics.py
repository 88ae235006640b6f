"""Metrics of predicted chances, by hand and by counting pairs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dextron_bench.success import metrics


def test_metrics_by_hand():
    chances, outcomes = np.array([0.9, 0.6, 0.6, 0.1]), np.array([1, 1, 0, 0])
    result = metrics.evaluate(chances, outcomes)
    assert (result.rows, result.base_rate, result.accuracy, result.base_accuracy) == (4, 0.5, 0.75, 0.5)
    assert result.brier == pytest.approx((0.01 + 0.16 + 0.36 + 0.01) / 4)
    assert result.base_brier == 0.25
    assert result.auc == pytest.approx(3.5 / 4)  # One of four pairs is a tie.
    assert result.calibration_error == pytest.approx((0.1 + 2 * 0.1 + 0.1) / 4)


def test_auc_is_nan_if_all_outcomes_are_equal():
    assert np.isnan(metrics.auc(np.array([0.2, 0.3]), np.array([1, 1])))


@given(st.lists(st.tuples(st.floats(0, 1), st.integers(0, 1)), min_size=2, max_size=30))
def test_auc_is_the_share_of_pairs_in_the_right_order(pairs: list[tuple[float, int]]):
    chances, outcomes = (np.array(column) for column in zip(*pairs, strict=True))
    wins, losses = chances[outcomes == 1], chances[outcomes == 0]
    if len(wins) and len(losses):
        gaps = wins[:, None] - losses[None, :]
        assert metrics.auc(chances, outcomes) == pytest.approx(((gaps > 0) + 0.5 * (gaps == 0)).mean())
    _, _, counts = metrics.calibration(chances, outcomes)
    assert counts.sum() == len(pairs)
