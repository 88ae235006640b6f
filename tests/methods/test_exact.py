"""Perceptron: outputs by hand, compared with float64 layers, and equal for any batch."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dextron_bench.methods.exact import BLOCK, Perceptron, to_integers


def layers(rng: np.random.Generator, *sizes: int) -> list[tuple[np.ndarray, np.ndarray]]:
    pairs = pairwise(sizes)
    return [(rng.normal(size=(before, after)) / before**0.5, rng.normal(size=after)) for before, after in pairs]


def test_two_layers_by_hand():
    network = Perceptron(
        [(np.array([[1.0, -2.0]]), np.array([0.5, 0.0])), (np.array([[2.0], [3.0]]), np.array([-1.0]))]
    )
    x = np.array([[1.0], [-1.0]])  # Hidden: (1.5, 0) and (0, 2).
    np.testing.assert_array_equal(network(x), [[2.0], [5.0]])


def test_outputs_are_bit_equal_in_any_part_of_a_batch():
    rng = np.random.default_rng(1)
    network, x = Perceptron(layers(rng, 48, 256, 256, 2)), rng.normal(size=(3 * BLOCK + 5, 48))
    together = network(x)
    for rows in (np.arange(1), np.arange(7), np.arange(BLOCK, 2 * BLOCK + 1), rng.permutation(len(x))):
        assert network(x[rows]).tobytes() == together[rows].tobytes()


@pytest.mark.parametrize("zeros", [0, 100, 256])
def test_outputs_are_bit_equal_without_columns_of_zeros(zeros: int):
    rng = np.random.default_rng(4)
    network, x = Perceptron(layers(rng, 256, 256, 2)), rng.normal(size=(400, 256))
    x[:, :zeros] = 0.0
    assert network(x, alike=True).tobytes() == network(x).tobytes()


def test_outputs_are_bit_equal_for_any_order_of_terms():
    """Plain sums of floats are not: their order may differ between processors."""
    rng = np.random.default_rng(2)
    weight, bias, x, order = rng.normal(size=(256, 3)), np.zeros(3), rng.normal(size=(40, 256)), rng.permutation(256)
    assert (x @ weight != x[:, order] @ weight[order]).any()
    assert Perceptron([(weight, bias)])(x).tobytes() == Perceptron([(weight[order], bias)])(x[:, order]).tobytes()


def test_outputs_are_as_precise_as_float32():
    rng = np.random.default_rng(3)
    weights, x = layers(rng, 48, 256, 256, 2), rng.normal(size=(50, 48))
    plain = x
    for i, (weight, bias) in enumerate(weights):
        plain = plain @ weight + bias
        plain = np.maximum(plain, 0.0) if i < 2 else plain
    np.testing.assert_allclose(Perceptron(weights)(x), plain, atol=1e-5)


@given(arrays(np.float64, (3, 5), elements=st.floats(-1e100, 1e100)), st.integers(4, 26))
def test_integers_have_few_bits_and_are_near_the_numbers(x: np.ndarray, bits: int):
    integers, units = to_integers(x, bits, axis=1)
    assert (integers == np.rint(integers)).all()
    assert np.abs(integers).max() <= 2**bits
    assert (np.abs(integers * units - x) <= units / 2).all()


def test_tiny_numbers_and_empty_batches_give_finite_outputs():
    network = Perceptron([(np.full((2, 1), 5e-324), np.zeros(1))])
    np.testing.assert_array_equal(network(np.array([[1e300, 0.0], [0.0, 5e-324]])), [[0.0], [0.0]])
    assert network(np.zeros((0, 2))).shape == (0, 1)


def test_a_row_that_is_not_finite_does_not_change_other_rows():
    network = Perceptron([(np.eye(2), np.zeros(2))])
    outputs = network(np.array([[np.nan, 1.0], [0.5, 0.25]]))
    assert np.isnan(outputs[0]).any()
    np.testing.assert_array_equal(outputs[1], [0.5, 0.25])


def test_layers_that_do_not_fit_raise():
    with pytest.raises(ValueError, match="do not follow"):
        Perceptron([(np.zeros((2, 3)), np.zeros(3)), (np.zeros((4, 1)), np.zeros(1))])


@pytest.mark.parametrize("bias", [np.zeros(2), np.zeros(4)])
def test_biases_that_do_not_fit_raise(bias: np.ndarray):
    with pytest.raises(ValueError, match=r"biases of sizes \[\d\] do not fit layers of shapes"):
        Perceptron([(np.zeros((2, 3)), bias)])


def test_a_weight_without_two_axes_raises():
    with pytest.raises(ValueError, match="do not follow"):
        Perceptron([(np.zeros(3), np.zeros(1))])


@pytest.mark.parametrize("shape", [(2,), (4, 3), (1, 4, 2)])
def test_inputs_of_another_shape_raise(shape: tuple[int, ...]):
    with pytest.raises(ValueError, match=r"inputs must have shape \(N, 2\); got"):
        Perceptron([(np.eye(2), np.zeros(2))])(np.zeros(shape))


def test_layers_in_turn_and_tensors_count_as_arrays():
    """A generator was used up by the check, and the network became the identity; tensors gave products of 3 axes."""
    network = Perceptron((np.eye(2) * k, np.ones(2)) for k in (2.0, 3.0))
    tensor: Any = torch.tensor([[1.0, 2.0]])
    np.testing.assert_array_equal(network(tensor), [[10.0, 16.0]])
