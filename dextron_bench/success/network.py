"""The success model Omega(s, a): the chance that the grasp succeeds after action a in state s (paper, II.E)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor, nn

from dextron_bench.world import model

HIDDEN = 256
GRID = np.linspace(-1.0, 1.0, 51)  # The actions of a curve (paper, fig. 5).
CLIP = 10.0  # Scaled states are clipped to this far from 0.


class BadModel(ValueError):
    """Arrays that make no success model."""


class SuccessModel:
    """A perceptron of three layers and two classes; states scaled by a fixed mean and deviation (48,)."""

    def __init__(self, mean: np.ndarray, deviation: np.ndarray, seed: int = 0) -> None:
        """New networks, drawn from the seed."""
        sizes = (model.STATE + 1, HIDDEN, HIDDEN, 2)
        rng = np.random.default_rng([seed, 0])
        self.mean, self.deviation = np.asarray(mean, np.float32), np.asarray(deviation, np.float32)
        self.network = nn.Sequential(
            nn.Linear(sizes[0], sizes[1]), nn.ReLU(), nn.Linear(sizes[1], sizes[2]), nn.ReLU(), nn.Linear(*sizes[2:])
        )
        with torch.no_grad():
            for layer in self.layers:
                bound = layer.in_features**-0.5
                for parameter in (layer.weight, layer.bias):
                    parameter.copy_(torch.tensor(rng.uniform(-bound, bound, tuple(parameter.shape))))

    @property
    def layers(self) -> list[nn.Linear]:
        """The linear layers in order."""
        return [layer for layer in self.network if isinstance(layer, nn.Linear)]

    def inputs(self, states: np.ndarray, actions: np.ndarray) -> Tensor:
        """What the network takes, (N, 49), for states (N, 48) and actions (N,)."""
        scaled = np.clip((states - self.mean) / self.deviation, -CLIP, CLIP)
        return torch.tensor(np.concatenate([scaled, actions[:, None]], axis=1), dtype=torch.float32)

    def chance(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """The predicted chance of success, (N,), of actions (N,) in states (N, 48)."""
        with torch.inference_mode():
            return self.network(self.inputs(states, actions)).softmax(dim=1)[:, 1].double().numpy()

    def curve(self, states: np.ndarray) -> np.ndarray:
        """The chances (N, 51) of the actions of GRID in states (N, 48).

        The first layer is linear in the action, so that the states pass it once.
        """
        first, second, last = self.layers
        with torch.inference_mode():
            of_states = first(self.inputs(states, np.zeros(len(states))))
            grid = torch.tensor(GRID, dtype=torch.float32)[None, :, None]
            hidden = (of_states[:, None] + grid * first.weight[:, -1]).relu_()
            return last(second(hidden).relu_()).softmax(dim=2)[..., 1].double().numpy()

    def arrays(self) -> dict[str, np.ndarray]:
        """Copies of all that the model is."""
        found = {f"layer.{i}": p.detach().numpy().copy() for i, p in enumerate(self.network.parameters())}
        return found | {"mean": self.mean.copy(), "deviation": self.deviation.copy()}

    @classmethod
    def of(cls, arrays: Mapping[str, np.ndarray]) -> SuccessModel:
        """The model that gave these arrays; raises BadModel."""
        try:
            made = cls(arrays["mean"], arrays["deviation"])
            with torch.no_grad():
                for i, parameter in enumerate(made.network.parameters()):
                    parameter.copy_(torch.tensor(arrays[f"layer.{i}"]))
        except (KeyError, RuntimeError, TypeError) as error:
            raise BadModel(f"these arrays are no success model ({type(error).__name__}: {error})") from error
        if not all(np.isfinite(array).all() for array in arrays.values()):
            raise BadModel("a success model with numbers that are not finite")
        return made
