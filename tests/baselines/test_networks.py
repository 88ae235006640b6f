"""Stacked perceptrons: each perceptron computes the same as it does alone."""

import numpy as np
import torch
from torch.testing import assert_close

from baselines.networks import HIDDEN, Stack


def stack_of(*seeds: int) -> Stack:
    return Stack.make(3, 2, [np.random.default_rng(seed) for seed in seeds])


def test_two_hidden_relu_layers_by_hand():
    one, two = torch.ones(1, 1, 1), torch.tensor([[[2.0]]])
    stack = Stack([two, -one, one, one, two, 5.0 * one])  # 2 (relu(relu(2 x - 1) + 1)) + 5
    assert_close(stack(torch.tensor([[[3.0], [0.0]]])), torch.tensor([[[17.0], [7.0]]]))


def test_initial_parameters_are_within_their_bounds():
    parameters = stack_of(0).parameters
    assert [tuple(p.shape) for p in parameters] == [
        (1, 3, HIDDEN), (1, 1, HIDDEN), (1, HIDDEN, HIDDEN), (1, 1, HIDDEN), (1, HIDDEN, 2), (1, 1, 2),
    ]  # fmt: skip
    for parameter, bound in zip(parameters, [3**-0.5, 3**-0.5, 1 / 16, 1 / 16, 0.003, 0.003], strict=True):
        assert 0.6 * bound < parameter.abs().max() <= bound or parameter.numel() == 2


def test_a_perceptron_computes_the_same_alone_and_in_a_stack():
    x = torch.tensor(np.random.default_rng(5).normal(size=(2, 7, 3)), dtype=torch.float32)
    together = stack_of(8, 9)(x)
    assert_close(together[1:], stack_of(9)(x[1:]))
    assert not torch.allclose(together[:1], stack_of(9)(x[:1]))
