"""Perceptrons whose every output is the same at any batch size, on any number of threads and any machine.

A sum of floats depends on the order of its terms, which a matrix product chooses by shape and processor. Here both
factors are first rounded to whole multiples of a power of two, few enough bits that float64 holds every product and
every sum exactly: then no order can matter. The rounding is about that of float32.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

MANTISSA = 53  # Bits that float64 holds exactly.
BLOCK = 64  # Rows at once, so that what lies between the layers stays in the processor's cache.
STEPS = 2**24  # What `rounded` gives are whole multiples of its inverse.
SMALLEST = -400  # Exponent of two below which numbers count as 0, so that no unit over- or underflows.


class Perceptron:
    """Layers with ReLU between them, for N inputs at once."""

    def __init__(self, layers: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        """Takes weight (in, out) and bias (out,) or (1, out) of each layer in order; raises ValueError."""
        sizes = [weight.shape for weight, _ in layers]
        if not layers or any(wide[1] != narrow[0] for wide, narrow in pairwise(sizes)):
            raise ValueError(f"layers of shapes {sizes} do not follow each other")
        self._layers = [(_Whole(weight), np.asarray(bias, np.float64).reshape(-1)) for weight, bias in layers]

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Outputs (N, out), float64, for inputs (N, in)."""
        return np.concatenate([self._block(x[i : i + BLOCK]) for i in range(0, max(len(x), 1), BLOCK)])

    def _block(self, x: np.ndarray) -> np.ndarray:
        for weight, bias in self._layers[:-1]:
            x = np.maximum(weight.of(x) + bias, 0.0)
        weight, bias = self._layers[-1]
        return weight.of(x) + bias


class _Whole:
    """A matrix (in, out) as whole numbers and a unit for each column."""

    def __init__(self, matrix: np.ndarray) -> None:
        self._bits = (MANTISSA - int(matrix.shape[0] - 1).bit_length()) // 2
        self._numbers, self._units = whole(np.asarray(matrix, np.float64), self._bits, axis=0)

    def of(self, x: np.ndarray) -> np.ndarray:
        """The product (N, out) of rows (N, in) and the matrix."""
        numbers, units = whole(x, self._bits, axis=1)
        return (numbers @ self._numbers) * (units * self._units) + 0.0  # Makes -0 a 0.


def rounded(x: np.ndarray) -> np.ndarray:
    """Numbers to about the precision of float32: the last bits of tanh and exp differ from machine to machine."""
    return np.rint(x * STEPS) / STEPS


def whole(x: np.ndarray, bits: int, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Whole numbers of at most so many bits, and the units, powers of two and one a slice, whose multiples are x."""
    _, exponents = np.frexp(np.abs(x).max(axis=axis, keepdims=True))
    exponents = np.maximum(exponents, SMALLEST)
    return np.rint(x * np.ldexp(1.0, bits - exponents)), np.ldexp(1.0, exponents - bits)
