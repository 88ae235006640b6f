"""Parameters and an Adam optimiser's memory of them as named arrays, and back, bit for bit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

MEMORY = ("step", "exp_avg", "exp_avg_sq")


def save(parameters: Sequence[Tensor], optimiser: torch.optim.Optimizer) -> dict[str, np.ndarray]:
    """Copies of the parameters, as `layer.0`, ..., and of what the optimiser keeps of those it moves."""
    found = {f"layer.{i}": parameter for i, parameter in enumerate(parameters)}
    for i, parameter in enumerate(parameters):
        found |= {f"adam.{i}.{name}": tensor for name, tensor in optimiser.state.get(parameter, {}).items()}
    return {name: tensor.detach().cpu().numpy().copy() for name, tensor in found.items()}


@torch.no_grad()
def load(parameters: Sequence[Tensor], optimiser: torch.optim.Optimizer, saved: Mapping[str, np.ndarray]) -> None:
    """Puts parameters and optimiser where those were that `save` was told of."""
    for i, parameter in enumerate(parameters):
        parameter.copy_(torch.tensor(saved[f"layer.{i}"]))
        if f"adam.{i}.step" in saved:
            memory = {name: torch.tensor(saved[f"adam.{i}.{name}"], device=parameter.device) for name in MEMORY}
            optimiser.state[parameter] = memory
