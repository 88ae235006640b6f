"""Saves parameters and the state of their Adam optimiser as named arrays, and restores them bit for bit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

OPTIMISER_STATE = ("step", "exp_avg", "exp_avg_sq")


def save(parameters: Sequence[Tensor], optimiser: torch.optim.Optimizer) -> dict[str, np.ndarray]:
    """Copies of the parameters (`layer.0`, ...) and of the optimiser's state (`adam.0.step`, ...)."""
    tensors = {f"layer.{i}": parameter for i, parameter in enumerate(parameters)}
    for i, parameter in enumerate(parameters):
        tensors |= {f"adam.{i}.{name}": tensor for name, tensor in optimiser.state.get(parameter, {}).items()}
    return {name: tensor.detach().cpu().numpy().copy() for name, tensor in tensors.items()}


@torch.no_grad()
def load(parameters: Sequence[Tensor], optimiser: torch.optim.Optimizer, saved: Mapping[str, np.ndarray]) -> None:
    """Restores parameters and optimiser from the arrays that `save` returned."""
    for i, parameter in enumerate(parameters):
        parameter.copy_(torch.tensor(saved[f"layer.{i}"]))
        if f"adam.{i}.step" in saved:
            optimiser.state[parameter] = {
                name: torch.tensor(saved[f"adam.{i}.{name}"], device=parameter.device) for name in OPTIMISER_STATE
            }
