"""Stacked perceptrons: each is what it would be alone."""

import numpy as np
import torch
from torch.testing import assert_close

from baselines.networks import HIDDEN, Stack


def made(*seeds: int) -> Stack:
    return Stack.make(3, 2, [np.random.default_rng(seed) for seed in seeds])


def test_two_hidden_relu_layers_by_hand():
    one, two = torch.ones(1, 1, 1), torch.tensor([[[2.0]]])
    stack = Stack([two, -one, one, one, two, 5.0 * one])  # 2 (relu(relu(2 x - 1) + 1)) + 5
    assert_close(stack(torch.tensor([[[3.0], [0.0]]])), torch.tensor([[[17.0], [7.0]]]))


def test_hidden_layers_start_within_the_root_of_their_inputs_and_the_last_close_to_zero():
    parameters = made(0).parameters
    assert [tuple(p.shape) for p in parameters] == [
        (1, 3, HIDDEN), (1, 1, HIDDEN), (1, HIDDEN, HIDDEN), (1, 1, HIDDEN), (1, HIDDEN, 2), (1, 1, 2),
    ]  # fmt: skip
    for parameter, bound in zip(parameters, [3**-0.5, 3**-0.5, 1 / 16, 1 / 16, 0.003, 0.003], strict=True):
        assert 0.6 * bound < parameter.abs().max() <= bound or parameter.numel() == 2


def test_a_perceptron_is_the_same_alone_and_beside_others():
    x = torch.tensor(np.random.default_rng(5).normal(size=(2, 7, 3)), dtype=torch.float32)
    together = made(8, 9)(x)
    assert_close(together[1:], made(9)(x[1:]))
    assert not torch.allclose(together[:1], made(9)(x[:1]))


def test_frozen_lets_gradients_through_to_the_input_alone():
    stack, x = made(0), torch.ones(1, 1, 3, requires_grad=True)
    stack.frozen()(x).sum().backward()
    assert x.grad is not None
    assert all(parameter.grad is None for parameter in stack.parameters)


def test_follow_moves_by_the_rate():
    target, leader = made(0).copy(), made(1)
    wanted = 0.75 * target.parameters[2] + 0.25 * leader.parameters[2].detach()
    target.average_with(leader, 0.25)
    assert_close(target.parameters[2], wanted)
