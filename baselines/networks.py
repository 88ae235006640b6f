"""Perceptrons of S agents side by side: one batched product does the work of S."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

HIDDEN = 256  # Units in each of the two hidden layers (paper, table II).
LAST = 0.003  # The last layer starts uniform between minus and plus this.


class Stack:
    """S perceptrons with two hidden ReLU layers and own parameters; inputs (S, B, in), outputs (S, B, out).

    `parameters` are weight (S, in, out) and bias (S, 1, out) of each layer in order.
    """

    def __init__(self, parameters: Sequence[Tensor]) -> None:
        self.parameters = list(parameters)

    @classmethod
    def make(cls, inputs: int, outputs: int, rngs: Sequence[np.random.Generator], device: str = "cpu") -> Stack:
        """New perceptrons, each drawn from its own generator: hidden layers as PyTorch draws them, uniform."""
        each = [_layers(inputs, outputs, rng) for rng in rngs]
        stacked = [np.stack(same).astype(np.float32) for same in zip(*each, strict=True)]
        return cls([torch.tensor(array, device=device).requires_grad_() for array in stacked])

    def __call__(self, x: Tensor) -> Tensor:
        weights, biases = self.parameters[::2], self.parameters[1::2]
        for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
            x = torch.baddbmm(bias, x, weight).relu_()
        return torch.baddbmm(biases[-1], x, weights[-1])

    def frozen(self) -> Stack:
        """The same perceptrons, through which no gradient reaches the parameters."""
        return Stack([parameter.detach() for parameter in self.parameters])

    def copy(self) -> Stack:
        """Perceptrons with equal parameters of their own that take no gradient."""
        return Stack([parameter.detach().clone() for parameter in self.parameters])

    @torch.no_grad()
    def follow(self, leader: Stack, rate: float) -> None:
        """Moves the parameters by `rate` of the way to the leader's (Polyak averaging)."""
        for parameter, other in zip(self.parameters, leader.parameters, strict=True):
            parameter.lerp_(other, rate)


def _layers(inputs: int, outputs: int, rng: np.random.Generator) -> list[np.ndarray]:
    sizes = (inputs, HIDDEN, HIDDEN, outputs)
    found = []
    for i, (wide, narrow) in enumerate(pairwise(sizes)):
        bound = LAST if i == len(sizes) - 2 else wide**-0.5
        found += [rng.uniform(-bound, bound, (wide, narrow)), rng.uniform(-bound, bound, (1, narrow))]
    return found
