"""Shared by the dm_control and Gymnasium environments: the validation of actions, and the order of settings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dextron_bench.reaches.setting import Setting, Source, checked_setting
from dextron_bench.reaches.sources import open_source


class ActionError(ValueError):
    """An invalid action; the message has its value and the valid ones."""


def validated_action(actions: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The actions as 64-bit floats of that shape. Raises ActionError.

    It refuses other shapes, NaN, and every value outside [-1, 1]. It does not clip values, so an action means the same
    in training, in evaluation and in a replay.
    """
    try:
        values = np.asarray(actions, dtype=np.float64)
    except (TypeError, ValueError):
        raise ActionError(f"actions must be numbers of shape {shape}; got {actions!r}") from None
    if values.shape != shape:
        raise ActionError(f"actions must have shape {shape}; got {values.shape}")
    invalid = values[~((values >= -1.0) & (values <= 1.0))]  # This form also selects NaN.
    if invalid.size:
        raise ActionError(f"actions must lie in [-1, 1] and are not clipped; got {float(invalid[0])!r}")
    return values


class SettingQueue:
    """Returns one setting for each episode: the settings of a list in turn, or random ones from the source."""

    def __init__(self, reaches: str | Source, settings: Sequence[Setting] | None = None) -> None:
        """Takes a source or its name.

        Raises UnknownSource, ValueError if the list is empty, and SettingError if it holds something else.
        """
        if settings is not None and not settings:
            raise ValueError("settings is an empty list; pass at least one setting, or None to draw from the source")
        self.source = open_source(reaches) if isinstance(reaches, str) else reaches
        self._settings = settings if settings is None else [checked_setting(setting) for setting in settings]
        self._position = 0

    def rewind(self) -> None:
        """Returns to the first setting of the list."""
        self._position = 0

    def next(self, rng: np.random.Generator) -> Setting:
        """The setting of the next episode. Draws from `rng` only if there is no list."""
        if self._settings is None:
            return self.source.sample(rng)
        self._position += 1
        return self._settings[(self._position - 1) % len(self._settings)]
