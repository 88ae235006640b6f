"""What the dm_control and Gymnasium faces share: which setting comes next, and which actions are refused."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.reaches.sources import open_source


class ActionError(ValueError):
    """An action that the world does not take; the message says what it was and what it must be."""


def validated_action(actions: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The actions as 64-bit floats of that shape; raises ActionError.

    Refused are other shapes, NaN, and anything beyond [-1, 1] by however little: nothing is clipped, so
    that an action means the same in training, in evaluation and in a replay.
    """
    try:
        values = np.asarray(actions, dtype=np.float64)
    except (TypeError, ValueError):
        raise ActionError(f"actions must be numbers of shape {shape}; got {actions!r}") from None
    if values.shape != shape:
        raise ActionError(f"actions must have shape {shape}; got {values.shape}")
    refused = values[~((values >= -1.0) & (values <= 1.0))]  # Written so that NaN is refused too.
    if refused.size:
        raise ActionError(f"actions must lie in [-1, 1] and are not clipped; got {float(refused[0])!r}")
    return values


class SettingQueue:
    """Deals one setting an episode: those of a list, over and over, or fresh draws from the source."""

    def __init__(self, reaches: str | Source, settings: Sequence[Setting] | None = None) -> None:
        """Takes a source or its name; raises UnknownSource, and ValueError where the list is empty."""
        if settings is not None and not settings:
            raise ValueError("settings is an empty list; give at least one, or None to draw from the source")
        self.source = open_source(reaches) if isinstance(reaches, str) else reaches
        self._listed = settings
        self._dealt = 0

    def rewind(self) -> None:
        """Goes back to the first setting of the list."""
        self._dealt = 0

    def next(self, rng: np.random.Generator) -> Setting:
        """The next episode's setting; `rng` is read only where there is no list."""
        if self._listed is None:
            return self.source.sample(rng)
        self._dealt += 1
        return self._listed[(self._dealt - 1) % len(self._listed)]
