"""OMEGA: in each state, takes the action with the highest predicted success, after Levine et al. (2018)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from dextron_bench import SuccessModel
from dextron_bench.errors import BadInput
from dextron_bench.reaches.sources import SOURCES
from dextron_bench.storage import hashing, tensors
from dextron_bench.success import network
from dextron_bench.success.network import GRID
from dextron_bench.world import task

FILE = ".safetensors"  # A model that ends so is a file, else it is a source of reaches.
OPEN = -1.0  # The default action of a hand that is far away, and of the first step.


@dataclass(frozen=True)
class Omega:
    """Takes the action with the highest predicted success; among about equal ones, opens or continues."""

    name: ClassVar[str] = "omega"

    tolerance: float = 0.02
    """Actions count as equally good if their predicted success is at most this much below the best."""
    near: float = 0.08
    """Among equally good actions: beyond this distance from the bottle [m], the one that opens most; within it, the one
    nearest to the last action."""
    model: str = field(default="", metadata={"in_label": False})
    """The file of a success model, or a source of reaches whose model ships; by default, the run's source."""
    sha256: str = field(default="", metadata={"in_label": False})
    """Refuse a model file with another SHA-256 than this."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.tolerance <= 1.0:
            raise BadInput(f"--tolerance is {self.tolerance:g}; a difference of probabilities lies between 0 and 1")
        if not self.near >= 0.0:
            raise BadInput(f"--near is {self.near:g}; a distance is 0 or more")

    def for_source(self, reaches: str) -> Self:
        """The method with the model of a source of reaches and its hash in its settings; raises BadInput."""
        named = replace(self, model=self.model or reaches)
        return replace(named, sha256=named.digest())

    def agent(self, seed: int) -> OmegaAgent:
        """The agent, the same for every seed; raises BadInput, BadTensors."""
        self.digest()
        file = Path(self.model)
        model = SuccessModel(tensors.read(file)) if self.model.endswith(FILE) else network.shipped_model(self.model)
        return OmegaAgent(model, self.tolerance, self.near)

    def digest(self) -> str:
        """The SHA-256 of the model's file, compared with `sha256` if that is set; raises BadInput, BadTensors."""
        if not self.model.endswith(FILE) and self.model not in SOURCES:
            sources = ", ".join(SOURCES)
            raise BadInput(f"--model takes the file of a model (*{FILE}) or one of {sources}, not {self.model!r}")
        try:
            digest = hashing.sha256(Path(self.model)) if self.model.endswith(FILE) else network.model_digest(self.model)
        except (OSError, network.MissingModel) as error:
            raise BadInput(f"there is no success model ({error}); --model takes the file of one") from error
        if digest != (self.sha256 or digest):
            raise BadInput(f"the success model {self.model!r} has the SHA-256 {digest}, not {self.sha256}")
        return digest


class OmegaAgent:
    """Acts by a success model; remembers the last action of each episode."""

    rows_are_independent = True

    def __init__(self, model: SuccessModel, tolerance: float, near: float) -> None:
        """Takes the model, and the settings `tolerance` and `near` of `Omega`."""
        self._model, self._tolerance, self._near = model, tolerance, near
        self._last = np.zeros(0)

    def reset(self, episodes: np.ndarray) -> None:
        """Forgets the last actions of rows `episodes` (n,), which begin a new episode."""
        self._grow(int(episodes.max(initial=-1)) + 1)
        self._last[episodes] = OPEN

    def act(self, states: np.ndarray) -> np.ndarray:
        """Closing speeds (N, 1) for states (N, 48)."""
        n = len(states)
        self._grow(n)
        preferred = np.where(task.distance(states) > self._near, OPEN, self._last[:n])
        self._last[:n] = choose(self._model.curve(states), preferred, self._tolerance)
        return self._last[:n, None].copy()

    def _grow(self, n: int) -> None:
        self._last = np.pad(self._last, (0, max(0, n - len(self._last))), constant_values=OPEN)


def choose(curves: np.ndarray, preferred: np.ndarray, tolerance: float) -> np.ndarray:
    """Actions (N,) of GRID for predicted probabilities of success (N, 51) and preferred actions (N,) of GRID.

    Among the actions within `tolerance` of the best probability, takes the nearest to the preferred action; of two
    equally near actions, the one that opens more. So a flat curve gives the preferred action.
    """
    good = curves >= curves.max(axis=1, keepdims=True) - tolerance
    step = GRID[1] - GRID[0]
    steps_away = np.abs(np.arange(len(GRID)) - np.rint((preferred - GRID[0]) / step)[:, None])  # Integers: exact ties.
    return GRID[np.where(good, steps_away, np.inf).argmin(axis=1)]
