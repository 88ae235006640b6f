"""Perceptrons of S agents: one batched matrix product computes all of them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

HIDDEN = 256  # Units in each of the two hidden layers (paper, table II).
LAST = 0.003  # The last layer is initialised uniformly within this bound.


class Stack:
    """S perceptrons with two hidden ReLU layers; maps inputs (S, B, in) to outputs (S, B, out).

    `parameters` are the weight (S, in, out) and the bias (S, 1, out) of each layer in order.
    """

    def __init__(self, parameters: Sequence[Tensor]) -> None:
        self.parameters = list(parameters)

    @classmethod
    def make(
        cls,
        inputs: int,
        outputs: int,
        rngs: Sequence[np.random.Generator],
        device: str = "cpu",
        hidden: int = HIDDEN,
    ) -> Stack:
        """New perceptrons with two layers of `hidden` units, each drawn from its own generator.

        Hidden layers are uniform, as in PyTorch.
        """
        layers = [_layers((inputs, hidden, hidden, outputs), rng) for rng in rngs]
        stacked = [np.stack(arrays).astype(np.float32) for arrays in zip(*layers, strict=True)]
        return cls([torch.tensor(array, device=device).requires_grad_() for array in stacked])

    def __call__(self, x: Tensor) -> Tensor:
        weights, biases = self.parameters[::2], self.parameters[1::2]
        for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
            x = torch.baddbmm(bias, x, weight).relu_()
        return torch.baddbmm(biases[-1], x, weights[-1])


def _layers(sizes: tuple[int, int, int, int], rng: np.random.Generator) -> list[np.ndarray]:
    layers = []
    for i, (before, after) in enumerate(pairwise(sizes)):
        bound = LAST if i == len(sizes) - 2 else before**-0.5
        layers += [rng.uniform(-bound, bound, (before, after)), rng.uniform(-bound, bound, (1, after))]
    return layers
