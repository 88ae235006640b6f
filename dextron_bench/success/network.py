"""The success model Omega(s, a): the chance that the grasp succeeds after action a in state s (paper, II.E)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import as_file, files
from importlib.resources.abc import Traversable
from typing import Any

import numpy as np

from dextron_bench.methods.exact import Perceptron, rounded
from dextron_bench.storage import hashing, tensors
from dextron_bench.world import model

HIDDEN = 256
SIZES = ((HIDDEN, model.STATE + 1), (HIDDEN,), (HIDDEN, HIDDEN), (HIDDEN,), (2, HIDDEN), (2,))  # Of its layers.
GRID = np.linspace(-1.0, 1.0, 51)  # The actions of a curve (paper, fig. 5).
CLIP = 10.0  # Scaled states are clipped to this far from 0.


class BadModel(ValueError):
    """Arrays that make no success model."""


class MissingModel(LookupError):
    """A source of reaches for which no success model ships."""


class SuccessModel:
    """A perceptron of three layers and two classes on scaled states; its chances are the same at any batch size."""

    def __init__(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Takes `mean` and `deviation` (48,) of states, and weights and biases as `layer.0` to `layer.5`.

        Raises BadModel.
        """
        names = [f"layer.{i}" for i in range(len(SIZES))]
        wanted = dict(zip(names, SIZES, strict=True)) | dict.fromkeys(("mean", "deviation"), (model.STATE,))
        for name, shape in wanted.items():
            if name not in arrays or np.shape(arrays[name]) != shape:
                raise BadModel(f"these arrays are no success model: {name!r} is not of shape {shape}")
            if not np.isfinite(arrays[name]).all():
                raise BadModel(f"a success model with numbers in {name!r} that are not finite")
        if not (np.asarray(arrays["deviation"]) > 0.0).all():
            raise BadModel("a success model with a deviation of states that is not above 0")
        if more := sorted(arrays.keys() - wanted.keys()):
            raise BadModel(f"these arrays are no success model: they hold {more[0]!r} too; take its model.safetensors")
        self._mean, self._deviation = (np.asarray(arrays[name], np.float64) for name in ("mean", "deviation"))
        first, bias, *rest = (np.asarray(arrays[name], np.float64).T for name in names)
        self._of_states, self._of_action = Perceptron([(first[:-1], bias)]), first[-1]
        self._rest = Perceptron(list(zip(rest[::2], rest[1::2], strict=True)))

    def chance(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """The predicted chance of success, (N,), of actions (N,) in states (N, 48)."""
        return self._chances(self._seen(states) + actions[:, None] * self._of_action)

    def curve(self, states: np.ndarray) -> np.ndarray:
        """The chances (N, 51) of the actions of GRID in states (N, 48), as `chance` gives them."""
        hidden = self._seen(states)[:, None] + GRID[:, None] * self._of_action
        return self._chances(hidden.reshape(-1, HIDDEN)).reshape(-1, len(GRID))

    def _seen(self, states: np.ndarray) -> np.ndarray:
        """What the first layer makes of states (N, 48), without an action: (N, HIDDEN)."""
        return self._of_states(np.clip((states - self._mean) / self._deviation, -CLIP, CLIP))

    def _chances(self, hidden: np.ndarray) -> np.ndarray:
        against, in_favour = self._rest(np.maximum(hidden, 0.0)).T
        odds = np.exp(np.clip(against - in_favour, -50.0, 50.0))
        return rounded(1.0 / (1.0 + odds))


@cache
def shipped_model(reaches: str) -> SuccessModel:
    """The model that ships for a source of reaches; raises MissingModel."""
    with as_file(_model_file(reaches)) as file:
        return SuccessModel(tensors.read(file))


def training_info(reaches: str) -> dict[str, Any]:
    """What the file of the model that ships says of its training: `fit`, `rows`, `curve`; raises MissingModel."""
    with as_file(_model_file(reaches)) as file:
        return tensors.read_about(file)


def model_digest(reaches: str) -> str:
    """The SHA-256 of the file of the model that ships, hexadecimal; raises MissingModel."""
    with as_file(_model_file(reaches)) as file:
        return hashing.sha256(file)


def _model_file(reaches: str) -> Traversable:
    place = files("dextron_bench") / "data" / f"success-{reaches}.safetensors"
    if not place.is_file():
        raise MissingModel(f"no success model ships for {reaches} reaches; `dextron-bench success train` makes one")
    return place
