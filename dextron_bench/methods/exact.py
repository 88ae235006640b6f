"""Perceptrons whose outputs are the same at any batch size, on any number of threads and on any machine.

The rounding of a sum of floats depends on the order of its terms, and a matrix product chooses this order by shape and
processor. `Perceptron` first rounds both factors to integer multiples of a power of two. The integers have so few bits
that float64 holds every product and every sum exactly, so the order no longer matters. The precision is close
to float32.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

MANTISSA = 53  # Bits that float64 holds exactly.
BLOCK = 64  # Rows per block, so that the activations stay in the processor's cache.
WORTH = 0.9  # The share of columns below which a product without the others is quicker.
STEPS = 2**24  # `rounded` returns integer multiples of 1 / STEPS.
SMALLEST = -400  # Numbers below two to this power count as 0, so that no unit over- or underflows.


class Perceptron:
    """Linear layers with ReLU between them, for N inputs at once."""

    def __init__(self, layers: Iterable[tuple[np.ndarray, np.ndarray]]) -> None:
        """Takes weight (in, out) and bias (out,) or (1, out) of each layer in order; raises ValueError."""
        arrays = [(np.asarray(weight, np.float64), np.asarray(bias, np.float64).reshape(-1)) for weight, bias in layers]
        sizes = [weight.shape for weight, _ in arrays]
        is_matrix = all(len(size) == 2 for size in sizes)
        if not arrays or not is_matrix or any(before[1] != after[0] for before, after in pairwise(sizes)):
            raise ValueError(f"layers of shapes {sizes} do not follow each other")
        if any(len(bias) != weight.shape[1] for weight, bias in arrays):
            raise ValueError(f"biases of sizes {[len(bias) for _, bias in arrays]} do not fit layers of shapes {sizes}")
        self._inputs = sizes[0][0]
        self._layers = [(_IntegerMatrix(weight), bias) for weight, bias in arrays]

    def __call__(self, x: np.ndarray, alike: bool = False) -> np.ndarray:
        """Outputs (N, out), float64, for inputs (N, in).

        If some hundred rows are `alike`, with zeros in the same columns, this leaves out those columns. Raises
        ValueError for inputs of another shape.
        """
        x = np.asarray(x, np.float64)  # A tensor of torch has other rules for products.
        if x.shape[1:] != (self._inputs,):
            raise ValueError(f"inputs must have shape (N, {self._inputs}); got {x.shape}")
        rows = max(len(x), 1) if alike else BLOCK
        return np.concatenate([self._forward(x[i : i + rows], alike) for i in range(0, max(len(x), 1), rows)])

    def _forward(self, x: np.ndarray, alike: bool) -> np.ndarray:
        for layer, (weight, bias) in enumerate(self._layers):
            x = np.maximum(x, 0.0) if layer else x
            x = weight.product(x, alike) + bias
        return x


class _IntegerMatrix:
    """A matrix (in, out) as integers, with one unit per column."""

    def __init__(self, matrix: np.ndarray) -> None:
        self._bits = (MANTISSA - int(matrix.shape[0] - 1).bit_length()) // 2
        self._integers, self._units = to_integers(np.asarray(matrix, np.float64), self._bits, axis=0)

    def product(self, x: np.ndarray, alike: bool = False) -> np.ndarray:
        """The product (N, out) of rows (N, in) and the matrix; without columns that are 0 in all rows, if `alike`."""
        matrix = self._integers
        if alike and len(x) > len(matrix):  # Fewer rows would gain less than the copy of the matrix costs.
            used = x.any(axis=0)
            if 0.0 < used.mean() < WORTH:
                x, matrix = x[:, used], matrix[used]
        integers, units = to_integers(x, self._bits, axis=1)
        return (integers @ matrix) * (units * self._units) + 0.0  # Turns -0 into 0.


def rounded(x: np.ndarray) -> np.ndarray:
    """Rounds to about the precision of float32, because the last bits of tanh and exp differ between machines."""
    return np.rint(x * STEPS) / STEPS


def to_integers(x: np.ndarray, bits: int, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Integers of at most `bits` bits and the units to multiply them by; each slice along `axis` has one unit.

    The units are powers of two. The products are `x`, rounded.
    """
    _, exponents = np.frexp(np.abs(x).max(axis=axis, keepdims=True))
    exponents = np.maximum(exponents, SMALLEST)
    return np.rint(x * np.ldexp(1.0, bits - exponents)), np.ldexp(1.0, exponents - bits)
