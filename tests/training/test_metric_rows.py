"""Metrics that a method returns: every form of one number, and errors that name the metric and the method."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch

from dextron_bench.methods.agents import AgentError
from dextron_bench.training import metric_rows


@pytest.mark.parametrize(
    "value",
    [
        *(0.5, np.float32(0.5), np.array(0.5), np.array([0.5]), np.array([[0.5]], np.float32)),
        *(torch.tensor(0.5), torch.tensor([0.5], requires_grad=True)),
    ],
)
def test_every_form_of_one_number_is_a_metric(value: Any):
    numbers = metric_rows.numbers({"loss": value, "steps": np.int64(3)}, "mine")
    assert numbers == {"loss": 0.5, "steps": 3.0}
    assert {type(number) for number in numbers.values()} == {float}


def test_a_number_that_is_not_finite_is_left_to_the_loop_which_says_where_it_diverged():
    assert math.isnan(metric_rows.numbers({"loss": np.array([np.nan])}, "mine")["loss"])


@pytest.mark.parametrize("value", [None, np.zeros(2), torch.zeros(2, 2), [], [0.5, 1.0], "high", 1j, {"mean": 1.0}])
def test_the_error_for_another_value_names_the_metric_and_the_method(value: Any):
    with pytest.raises(AgentError, match=r"^metric 'loss' of method 'mine' must be one number; got ") as caught:
        metric_rows.numbers({"frames": 1.0, "loss": value}, "mine")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("metrics", [{"epoch": 1.0}, {"seed": 0.0}, {3: 1.0}, None, [0.5]])
def test_metrics_that_would_damage_the_row_are_refused(metrics: Any):
    with pytest.raises(AgentError, match="method 'mine'"):
        metric_rows.numbers(metrics, "mine")
