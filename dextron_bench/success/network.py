"""The success model Omega(s, a): the chance that the grasp succeeds after action a in state s (paper, II.E)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import as_file, files
from importlib.resources.abc import Traversable

import numpy as np

from dextron_bench.errors import BadInput, NotFound
from dextron_bench.methods.exact import Perceptron, rounded
from dextron_bench.storage import hashing, tensors
from dextron_bench.world import model

HIDDEN = 256
SIZES = ((HIDDEN, model.STATE + 1), (HIDDEN,), (HIDDEN, HIDDEN), (HIDDEN,), (2, HIDDEN), (2,))  # Of weights and biases.
GRID = np.linspace(-1.0, 1.0, 51)  # The actions of a curve (paper, Fig. 5).
BLOCK = 8  # States whose curves are computed together: alike, if they follow each other, and few enough for the cache.
CLIP = 10.0  # Scaled states are clipped to [-CLIP, CLIP].


class MissingModel(NotFound):
    """No success model ships for the source of reaches."""


class SuccessModel:
    """A perceptron with three layers and two classes on scaled states. Its chances do not depend on the batch size."""

    def __init__(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Takes `mean` and `deviation` (48,) of states, and weights and biases as `layer.0` to `layer.5` (SIZES).

        Raises BadInput.
        """
        names = [f"layer.{i}" for i in range(len(SIZES))]
        _check(arrays, dict(zip(names, SIZES, strict=True)) | dict.fromkeys(("mean", "deviation"), (model.STATE,)))
        self._mean, self._deviation = (np.asarray(arrays[name], np.float64) for name in ("mean", "deviation"))
        first, bias, *rest = (np.asarray(arrays[name], np.float64).T for name in names)
        self._state_layer, self._action_weights = Perceptron([(first[:-1], bias)]), first[-1]
        self._upper_layers = Perceptron(list(zip(rest[::2], rest[1::2], strict=True)))

    def chance(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """The predicted chances of success (N,) of actions (N,) in states (N, 48)."""
        return self._chances(self._hidden(states) + actions[:, None] * self._action_weights)

    def curve(self, states: np.ndarray) -> np.ndarray:
        """The chances (N, 51) of the actions of GRID in states (N, 48), bit-equal to the results of `chance`."""
        hidden, actions = self._hidden(states)[:, None], GRID[:, None] * self._action_weights
        parts = [
            self._chances((hidden[i : i + BLOCK] + actions).reshape(-1, HIDDEN), alike=True)
            for i in range(0, max(len(hidden), 1), BLOCK)
        ]
        return np.concatenate(parts).reshape(-1, len(GRID))

    def _hidden(self, states: np.ndarray) -> np.ndarray:
        """The part (N, HIDDEN) of the first layer's output that depends on states (N, 48) only, not on an action."""
        return self._state_layer(np.clip((states - self._mean) / self._deviation, -CLIP, CLIP))

    def _chances(self, hidden: np.ndarray, alike: bool = False) -> np.ndarray:
        failure, success = self._upper_layers(np.maximum(hidden, 0.0), alike).T
        odds = np.exp(np.clip(failure - success, -50.0, 50.0))
        return rounded(1.0 / (1.0 + odds))


def _check(arrays: Mapping[str, np.ndarray], shapes: Mapping[str, tuple[int, ...]]) -> None:
    for name, shape in shapes.items():
        if name not in arrays or np.shape(arrays[name]) != shape:
            raise BadInput(f"these arrays are not a success model: {name!r} does not have the shape {shape}")
        if not np.isfinite(arrays[name]).all():
            raise BadInput(f"a success model needs finite numbers; {name!r} holds others")
    if not (np.asarray(arrays["deviation"]) > 0.0).all():
        raise BadInput("a success model needs a 'deviation' above 0 for every number of a state")
    if extra := sorted(arrays.keys() - shapes.keys()):
        raise BadInput(f"these arrays are not a success model: they also hold {extra[0]!r}; take a model.safetensors")


@cache
def shipped_model(reaches: str) -> SuccessModel:
    """The success model that ships for a source of reaches; raises MissingModel."""
    with as_file(model_file(reaches)) as file:
        return SuccessModel(tensors.read(file))


def model_digest(reaches: str) -> str:
    """SHA-256, hexadecimal, of the file of the model that ships for a source of reaches; raises MissingModel."""
    with as_file(model_file(reaches)) as file:
        return hashing.sha256(file)


def model_file(reaches: str) -> Traversable:
    """The file of the model that ships for a source of reaches; raises MissingModel."""
    file = files("dextron_bench") / "data" / f"success-{reaches}.safetensors"
    if not file.is_file():
        raise MissingModel(f"no success model ships for {reaches} reaches; `dextron-bench success train` makes one")
    return file
