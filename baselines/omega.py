"""OMEGA: in each state the action that the success model likes best, as its inspiration acts (Levine et al., 2018)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from dextron_bench import SuccessModel
from dextron_bench.reaches.sources import SOURCES
from dextron_bench.storage import hashing, tensors
from dextron_bench.success import network
from dextron_bench.success.network import GRID
from dextron_bench.world import task

FILE = ".safetensors"  # What names a file, not a source of reaches.
OPENS = -1.0  # What a hand does that is still far away, or has done nothing yet.


class BadRule(ValueError):
    """A tolerance outside [0, 1], or a distance below 0."""


class NoModel(ValueError):
    """A success model that is not there, or is another than was asked for."""


@dataclass(frozen=True)
class Omega:
    """Takes the action that the success model likes best; of those about as good, opens or goes on."""

    name: ClassVar[str] = "omega"

    tolerance: float = 0.02
    """Actions whose chance of success is at most this much below the best one's count as equally good."""
    near: float = 0.08
    """Of such, the one that opens most while the hand is farther than this from the bottle [m]; then the nearest to the
    last one."""
    model: str = ""
    """The file of a success model, or a source of reaches for which one ships; by default that of the run."""
    sha256: str = ""
    """Refuse to act with another file of the model than the one that has this hash."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.tolerance <= 1.0:
            raise BadRule(f"--tolerance is {self.tolerance:g}; a difference of chances lies between 0 and 1")
        if not self.near >= 0.0:
            raise BadRule(f"--near is {self.near:g}; a distance is 0 or more")

    def for_source(self, reaches: str) -> Self:
        """The same, told which model it acts with on a source of reaches; raises NoModel."""
        named = replace(self, model=self.model or reaches)
        return replace(named, sha256=named.digest())

    def agent(self, seed: int) -> OmegaAgent:
        """The same for every seed; raises NoModel, BadModel, BadTensors."""
        self.digest()
        file = Path(self.model)
        found = SuccessModel(tensors.read(file)) if self.model.endswith(FILE) else network.shipped_model(self.model)
        return OmegaAgent(found, self.tolerance, self.near)

    def digest(self) -> str:
        """The SHA-256 of the model's file; raises NoModel, BadTensors."""
        if not self.model.endswith(FILE) and self.model not in SOURCES:
            known = ", ".join(SOURCES)
            raise NoModel(f"--model takes the file of a model (*{FILE}) or one of {known}, not {self.model!r}")
        try:
            found = hashing.sha256(Path(self.model)) if self.model.endswith(FILE) else network.model_digest(self.model)
        except (OSError, network.MissingModel) as error:
            raise NoModel(f"no success model at hand ({error}); --model takes the file of one") from error
        if found != (self.sha256 or found):
            raise NoModel(f"the success model {self.model!r} has the SHA-256 {found}, not {self.sha256}")
        return found


class OmegaAgent:
    """Remembers of each episode the action it took last."""

    def __init__(self, model: SuccessModel, tolerance: float, near: float) -> None:
        """Takes the model, and the two numbers of its rule (see `Omega`)."""
        self._model, self._tolerance, self._near = model, tolerance, near
        self._last = np.zeros(0)

    def reset(self, episodes: np.ndarray) -> None:
        """Forgets what it did in `episodes` (n,), which begin anew."""
        self._make_room(int(episodes.max(initial=-1)) + 1)
        self._last[episodes] = OPENS

    def act(self, states: np.ndarray) -> np.ndarray:
        """Closing speeds (N, 1) for states (N, 48)."""
        n = len(states)
        self._make_room(n)
        wanted = np.where(task.distance(states) > self._near, OPENS, self._last[:n])
        self._last[:n] = choose(self._model.curve(states), wanted, self._tolerance)
        return self._last[:n, None].copy()

    def _make_room(self, n: int) -> None:
        self._last = np.pad(self._last, (0, max(0, n - len(self._last))), constant_values=OPENS)


def choose(curves: np.ndarray, wanted: np.ndarray, tolerance: float) -> np.ndarray:
    """Actions (N,) of GRID for curves of chances (N, 51) and what one would do without them, actions (N,) of GRID.

    Of the actions whose chance is within `tolerance` of the best, the nearest to the one wanted; of two as near the
    one that opens more. Where a curve is flat it says nothing, and what is wanted is done.
    """
    good = curves >= curves.max(axis=1, keepdims=True) - tolerance
    step = GRID[1] - GRID[0]
    away = np.abs(np.arange(len(GRID)) - np.rint((wanted - GRID[0]) / step)[:, None])  # Whole, so that ties are ties.
    return GRID[np.where(good, away, np.inf).argmin(axis=1)]
