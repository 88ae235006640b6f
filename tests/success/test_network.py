"""The success model's network: curves, chances by hand, and arrays that it refuses."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dextron_bench.errors import BadInput
from dextron_bench.success.network import GRID, SIZES, MissingModel, SuccessModel, shipped_model
from dextron_bench.success.training import initial_network


def arrays() -> dict[str, np.ndarray]:
    """Random arrays of a success model."""
    rng = np.random.default_rng(0)
    layers = {f"layer.{i}": rng.normal(size=shape) / shape[-1] ** 0.5 for i, shape in enumerate(SIZES)}
    return layers | {"mean": rng.normal(size=48), "deviation": rng.uniform(0.5, 2.0, 48)}


def test_a_curve_has_the_chance_of_each_action_of_the_grid_bit_for_bit():
    model, states = SuccessModel(arrays()), np.random.default_rng(1).normal(size=(4, 48))
    curve = model.curve(states)
    assert curve.shape == (4, 51)
    for k in (0, 17, 50):
        np.testing.assert_array_equal(curve[:, k], model.chance(states, np.full(4, GRID[k])))
    np.testing.assert_array_equal(model.curve(states[2:3]), curve[2:3])
    np.testing.assert_allclose(GRID[[0, 1, 50]], [-1.0, -0.96, 1.0])


def test_chances_are_a_softmax_of_two_classes_by_hand():
    zeros = {name: np.zeros_like(array) for name, array in arrays().items()}
    model = SuccessModel(zeros | {"deviation": np.ones(48), "layer.5": np.array([0.0, np.log(3.0)])})
    np.testing.assert_allclose(model.chance(np.ones((2, 48)), np.zeros(2)), 0.75, rtol=1e-6)


def test_chances_equal_those_of_the_trained_torch_network():
    network, rng = initial_network(np.random.default_rng(0)), np.random.default_rng(1)
    layers = {f"layer.{i}": parameter.detach().numpy() for i, parameter in enumerate(network.parameters())}
    states, actions = rng.normal(size=(30, 48)), rng.uniform(-1.0, 1.0, 30)
    expected = network(torch.tensor(np.c_[states, actions], dtype=torch.float32)).softmax(dim=1)[:, 1]
    model = SuccessModel(layers | {"mean": np.zeros(48), "deviation": np.ones(48)})
    np.testing.assert_allclose(model.chance(states, actions), expected.detach().numpy(), atol=1e-6)


def test_arrays_that_are_not_a_success_model_are_refused():
    with pytest.raises(BadInput, match=r"'layer.1' does not have the shape \(256,\)"):
        SuccessModel(arrays() | {"layer.1": np.zeros(3)})
    with pytest.raises(BadInput, match="finite numbers; 'mean' holds others"):
        SuccessModel(arrays() | {"mean": np.full(48, np.nan)})
    with pytest.raises(BadInput, match="needs a 'deviation' above 0"):
        SuccessModel(arrays() | {"deviation": np.zeros(48)})
    with pytest.raises(BadInput, match=r"they also hold 'adam.0.step'; take a model\.safetensors"):
        SuccessModel(arrays() | {"adam.0.step": np.zeros(1)})
    with pytest.raises(MissingModel, match="no success model ships for minjerk"):
        shipped_model("minjerk")
