"""The perceptron whose outputs do not depend on the batch, by hand and against the plain one."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dextron_bench.methods.exact import BLOCK, Perceptron, to_integers


def layers(rng: np.random.Generator, *sizes: int) -> list[tuple[np.ndarray, np.ndarray]]:
    pairs = pairwise(sizes)
    return [(rng.normal(size=(wide, narrow)) / wide**0.5, rng.normal(size=narrow)) for wide, narrow in pairs]


def test_two_layers_by_hand():
    network = Perceptron(
        [(np.array([[1.0, -2.0]]), np.array([0.5, 0.0])), (np.array([[2.0], [3.0]]), np.array([-1.0]))]
    )
    x = np.array([[1.0], [-1.0]])  # Hidden: (1.5, 0) and (0, 2).
    np.testing.assert_array_equal(network(x), [[2.0], [5.0]])


def test_any_part_of_a_batch_in_any_order_gives_the_same_bits():
    rng = np.random.default_rng(1)
    network, x = Perceptron(layers(rng, 48, 256, 256, 2)), rng.normal(size=(3 * BLOCK + 5, 48))
    together = network(x)
    for rows in (np.arange(1), np.arange(7), np.arange(BLOCK, 2 * BLOCK + 1), rng.permutation(len(x))):
        assert network(x[rows]).tobytes() == together[rows].tobytes()


def test_terms_in_any_order_give_the_same_bits():
    """Which plain sums of floats do not: that is what may differ between processors."""
    rng = np.random.default_rng(2)
    weight, bias, x, order = rng.normal(size=(256, 3)), np.zeros(3), rng.normal(size=(40, 256)), rng.permutation(256)
    assert (x @ weight != x[:, order] @ weight[order]).any()
    assert Perceptron([(weight, bias)])(x).tobytes() == Perceptron([(weight[order], bias)])(x[:, order]).tobytes()


def test_it_is_as_close_to_the_plain_network_as_float32_is():
    rng = np.random.default_rng(3)
    made, x = layers(rng, 48, 256, 256, 2), rng.normal(size=(50, 48))
    plain = x
    for i, (weight, bias) in enumerate(made):
        plain = plain @ weight + bias
        plain = np.maximum(plain, 0.0) if i < 2 else plain
    np.testing.assert_allclose(Perceptron(made)(x), plain, atol=1e-5)


@given(arrays(np.float64, (3, 5), elements=st.floats(-1e100, 1e100)), st.integers(4, 26))
def test_whole_numbers_are_whole_of_few_bits_and_near(x: np.ndarray, bits: int):
    numbers, units = to_integers(x, bits, axis=1)
    assert (numbers == np.rint(numbers)).all()
    assert np.abs(numbers).max() <= 2**bits
    assert (np.abs(numbers * units - x) <= units / 2).all()


def test_nothing_infinite_comes_of_tiny_numbers_or_none():
    network = Perceptron([(np.full((2, 1), 5e-324), np.zeros(1))])
    np.testing.assert_array_equal(network(np.array([[1e300, 0.0], [0.0, 5e-324]])), [[0.0], [0.0]])
    assert network(np.zeros((0, 2))).shape == (0, 1)


def test_a_row_that_is_not_finite_spoils_no_other():
    network = Perceptron([(np.eye(2), np.zeros(2))])
    found = network(np.array([[np.nan, 1.0], [0.5, 0.25]]))
    assert np.isnan(found[0]).any()
    np.testing.assert_array_equal(found[1], [0.5, 0.25])


def test_layers_that_do_not_fit_are_told():
    with pytest.raises(ValueError, match="do not follow"):
        Perceptron([(np.zeros((2, 3)), np.zeros(3)), (np.zeros((4, 1)), np.zeros(1))])
