"""Forward and backward passes of stacked perceptrons by hand: fewer and larger operations than automatic ones.

All parameters lie in one vector, and so do their gradients, so an optimiser updates them in one operation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from baselines.networks import Stack

ALL = slice(None)


@dataclass(frozen=True, slots=True)
class Pass:
    """What a forward pass computed: inputs (n, B, in), both hidden layers (n, B, hidden), and outputs (n, B, out)."""

    inputs: Tensor
    first: Tensor
    second: Tensor
    outputs: Tensor


class Joined:
    """Several stacks of perceptrons joined to one of n, padded with zeros to equal numbers of inputs and of outputs.

    A padded input must be 0, and the gradient of a padded output too; then the padding stays 0.
    """

    def __init__(self, stacks: Sequence[Stack]) -> None:
        """Copies the parameters of stacks with equal hidden layers."""
        first, *_, last = zip(*(stack.parameters for stack in stacks), strict=True)
        inputs, outputs = max(w.shape[1] for w in first), max(b.shape[2] for b in last)
        parts = [_padded(stack.parameters, inputs, outputs) for stack in stacks]
        layers = [torch.cat(layer) for layer in zip(*parts, strict=True)]
        self._shapes = [layer.shape for layer in layers]
        self.values = torch.cat([layer.flatten() for layer in layers])
        self.gradients = torch.zeros_like(self.values)
        self._layers, self._layer_gradients = self.layers_of(self.values), self.layers_of(self.gradients)

    def layers_of(self, vector: Tensor) -> list[Tensor]:
        """A vector as the weight and the bias of each layer in order."""
        sizes = [math.prod(shape) for shape in self._shapes]
        return [part.view(shape) for part, shape in zip(vector.split(sizes), self._shapes, strict=True)]

    def parameters(self, part: slice = ALL, inputs: int | None = None, outputs: int | None = None) -> list[Tensor]:
        """Views of some perceptrons' weights and biases, as in `Stack`, without the padding."""
        w1, b1, w2, b2, w3, b3 = (layer[part] for layer in self._layers)
        return [w1[:, :inputs], b1, w2, b2, w3[..., :outputs], b3[..., :outputs]]

    def forward(self, inputs: Tensor, part: slice = ALL) -> Pass:
        """Computes some perceptrons for inputs (n, B, in)."""
        w1, b1, w2, b2, w3, b3 = (layer[part] for layer in self._layers)
        first = torch.baddbmm(b1, inputs, w1).relu_()
        second = torch.baddbmm(b2, first, w2).relu_()
        return Pass(inputs, first, second, torch.baddbmm(b3, second, w3))

    def backward(self, done: Pass, slope: Tensor) -> None:
        """Sets `gradients` for the slope (n, B, out) of a loss in the outputs of a pass of all perceptrons."""
        _, _, w2, _, w3, _ = self._layers
        w1_slope, b1_slope, w2_slope, b2_slope, w3_slope, b3_slope = self._layer_gradients
        torch.bmm(done.second.mT, slope, out=w3_slope)
        torch.sum(slope, 1, keepdim=True, out=b3_slope)
        slope = _through_relu(torch.bmm(slope, w3.mT), done.second)
        torch.bmm(done.first.mT, slope, out=w2_slope)
        torch.sum(slope, 1, keepdim=True, out=b2_slope)
        slope = _through_relu(torch.bmm(slope, w2.mT), done.first)
        torch.bmm(done.inputs.mT, slope, out=w1_slope)
        torch.sum(slope, 1, keepdim=True, out=b1_slope)

    def input_slope(self, done: Pass, slope: Tensor, part: slice, column: int) -> Tensor:
        """Slope (n, B, 1) of a loss in one input, from its slope (n, B, out) in the outputs of a pass of a part."""
        w1, _, w2, _, w3, _ = (layer[part] for layer in self._layers)
        slope = _through_relu(torch.bmm(slope, w3.mT), done.second)
        slope = _through_relu(torch.bmm(slope, w2.mT), done.first)
        return torch.bmm(slope, w1[:, column : column + 1].mT)


def _through_relu(slope: Tensor, activations: Tensor) -> Tensor:
    """The slope in the inputs of ReLU units, from the slope in their activations."""
    return torch.ops.aten.threshold_backward(slope, activations, 0)


def _padded(layers: Sequence[Tensor], inputs: int, outputs: int) -> list[Tensor]:
    """The layers of a stack with zeros for further inputs and outputs."""
    w1, b1, w2, b2, w3, b3 = (layer.detach() for layer in layers)
    further = outputs - w3.shape[2]
    pad = torch.nn.functional.pad
    return [pad(w1, (0, 0, 0, inputs - w1.shape[1])), b1, w2, b2, pad(w3, (0, further)), pad(b3, (0, further))]
