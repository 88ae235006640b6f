"""The infos of the Gymnasium environments: plain values only, which collectors store and vector environments stack."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from dextron_bench.reaches.setting import Setting, plain
from dextron_bench.world import task

Columns: TypeAlias = dict[str, "np.ndarray | Columns"]  # Of many slots, by name; the columns of a setting are inside.


def single(setting: Setting, episode_return: float, failure: str) -> dict[str, str | float | dict[str, str | float]]:
    """The info of one episode."""
    is_success = episode_return >= task.SUCCESS
    return {"setting": plain(setting), "episode_return": episode_return, "is_success": is_success, "failure": failure}


class SlotInfos:
    """The infos of N slots as arrays, in the form in which Gymnasium stacks the infos of single environments."""

    def __init__(self, slots: int) -> None:
        self._reaches = np.empty(slots, object)
        self._numbers = {name: np.zeros(slots) for name in ("offset_x", "offset_y", "duration_noise")}

    def begin(self, slot: int, setting: Setting) -> None:
        """An episode in a setting begins in a slot."""
        self._reaches[slot] = setting.reach
        for name, numbers in self._numbers.items():
            numbers[slot] = getattr(setting, name)

    def of(self, mask: np.ndarray, returns: np.ndarray, failures: np.ndarray) -> Columns:
        """The info of the slots where `mask` (n,) is true; other entries are empty. Each name has a mask."""
        return _masked(
            {
                "setting": {"reach": self._reaches, **self._numbers},
                "episode_return": returns,
                "is_success": returns >= task.SUCCESS,
                "failure": failures,
            },
            mask,
        )


def objects(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The rows of `values` (n, ...) as n objects where `mask` (n,) is true, None elsewhere."""
    kept = np.full(len(mask), None, object)
    for slot in np.flatnonzero(mask).tolist():
        kept[slot] = values[slot]
    return kept


def _masked(columns: Columns, mask: np.ndarray) -> Columns:
    """Copies of the columns with a mask for each; a number is 0 and an object None where it is false."""
    infos: Columns = {}
    for name, column in columns.items():
        if isinstance(column, dict):
            infos[name] = _masked(column, mask)
        else:
            infos[name] = np.where(mask, column, np.array(None if column.dtype == object else 0, column.dtype))
        infos[f"_{name}"] = mask.copy()
    return infos
