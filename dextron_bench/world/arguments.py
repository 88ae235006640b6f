"""The checked arguments of the Gymnasium environments: counts, seeds, settings, and the slots to reset."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Integral
from typing import Any

import numpy as np

from dextron_bench.reaches.setting import Setting, checked_setting

Options = Mapping[str, Any] | None


def slot_count(slots: Any) -> int:
    """A number of slots as a Python integer. Raises ValueError."""
    if not isinstance(slots, Integral) or slots < 1:
        raise ValueError(f"num_envs must be an integer of at least 1; got {slots!r}")
    return int(slots)


def step_limit(limit: Any) -> float:
    """The steps after which an episode is truncated: infinite for None or -1, as in Gymnasium. Raises ValueError."""
    if limit is None or limit == -1:
        return math.inf
    if not isinstance(limit, Integral) or limit < 1:
        raise ValueError(f"max_episode_steps must be an integer of at least 1, -1 or None; got {limit!r}")
    return int(limit)


def seed_number(seed: Any) -> int | None:
    """A seed as a Python integer, which Gymnasium requires; Gymnasium refuses what is no integer."""
    return int(seed) if isinstance(seed, Integral) else seed


def slot_seeds(seed: Any, slots: int) -> list[int | None]:
    """The seed of each slot: `seed + k` for slot k, or the k-th of a list. Raises ValueError, TypeError."""
    if seed is None:
        return [None] * slots
    if isinstance(seed, Integral):
        return [int(seed) + k for k in range(slots)]
    if isinstance(seed, str) or not hasattr(seed, "__len__"):
        raise TypeError(f"seed must be an integer, or a list of {slots} integers; got {seed!r}")
    if len(seed) != slots:
        raise ValueError(f"a list of seeds must have one for each of the {slots} slots; got {len(seed)}")
    return [seed_number(one) for one in seed]


def chosen_setting(options: Options) -> Setting | None:
    """The `setting` of the options, or None if they have none. Raises BadInput."""
    value = (options or {}).get("setting")
    return None if value is None else checked_setting(value)


def slot_settings(options: Options, slots: int) -> list[Setting | None]:
    """The setting of each slot: the `setting` of the options for all, or the k-th of a list, which may be None.

    Raises BadInput, and ValueError if a list has another length.
    """
    value = (options or {}).get("setting")
    if not isinstance(value, list | tuple | np.ndarray):
        return [chosen_setting(options)] * slots
    if len(value) != slots:
        raise ValueError(f"options['setting'] must have one setting for each of the {slots} slots; got {len(value)}")
    return [None if one is None else checked_setting(one) for one in value]


def reset_mask(options: Options, slots: int) -> np.ndarray:
    """True for the slots to reset, shape (n,): the `reset_mask` of the options, or all.

    Raises TypeError for another type, and ValueError for another shape or no slot.
    """
    mask = (options or {}).get("reset_mask")
    if mask is None:
        return np.ones(slots, bool)
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
        raise TypeError(f"options['reset_mask'] must be a NumPy array of bool; got {mask!r}")
    if mask.shape != (slots,):
        raise ValueError(f"options['reset_mask'] must have shape ({slots},); got {mask.shape}")
    if not mask.any():
        raise ValueError("options['reset_mask'] must be true for at least one slot")
    return mask.copy()
