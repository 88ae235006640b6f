"""Shared by the dm_control and Gymnasium environments: the validation of actions, and the order of settings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from dextron_bench.errors import BadInput
from dextron_bench.reaches.setting import Setting, Source, checked_setting
from dextron_bench.reaches.sources import open_source
from dextron_bench.world import task


def validated_action(actions: np.ndarray, shape: tuple[int, ...], ignored: np.ndarray | None = None) -> np.ndarray:
    """The actions as 64-bit floats of that shape, in [-1, 1] (see `task.clipped`). Raises BadInput.

    It refuses other shapes and types, NaN, and every value that lies outside the range by more than `task.LEEWAY`,
    except in rows where `ignored` is true. So an action means the same in training, in evaluation and in a replay.
    """
    try:
        given = np.asarray(actions)
        if given.dtype.kind not in "fiubO":  # NumPy would read texts as numbers, and drop imaginary parts.
            raise TypeError
        values = given.astype(np.float64)
    except (TypeError, ValueError):
        raise BadInput(f"actions must be numbers of shape {shape}; got {actions!r}") from None
    if values.shape != shape:
        raise BadInput(f"actions must have shape {shape}; got {values.shape}")
    clipped = task.clipped(values)
    is_invalid = np.isnan(clipped)
    if ignored is not None:
        is_invalid[ignored] = False
    invalid = values[is_invalid]
    if invalid.size:
        raise BadInput(f"actions must lie in [-1, 1]; got {float(invalid[0])!r}")
    return clipped


def _checked_settings(settings: object) -> list[Setting]:
    if not isinstance(settings, Iterable) or isinstance(settings, str | Mapping):
        raise BadInput(f"settings must be a list of settings; got {settings!r}")
    checked = [checked_setting(setting) for setting in settings]
    if not checked:
        raise ValueError("settings is an empty list; pass at least one setting, or None to draw from the source")
    return checked


class SettingQueue:
    """Returns one setting for each episode: the settings of a list in turn, or random ones from the source."""

    def __init__(self, reaches: str | Source, settings: Sequence[Setting] | None = None) -> None:
        """Takes a source or its name.

        A setting may be a mapping, as in an info. Raises UnknownSource, ValueError if the list is empty, BadInput
        if it is no list or holds something else, and TypeError for another source.
        """
        self.source = open_source(reaches) if isinstance(reaches, str) else reaches
        if not hasattr(self.source, "sample") or not hasattr(self.source, "path"):
            raise TypeError(f"reaches must be a source of reaches or its name; got {reaches!r}")
        self._settings = None if settings is None else _checked_settings(settings)
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
