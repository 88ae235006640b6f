"""Reads the training data of the success model in batches from the disk.

The arrays stay on the disk, so memory grows with the number of episodes and not with the number of transitions.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.errors import BadInput, NotFound
from dextron_bench.storage import records, tensors
from dextron_bench.storage.folders import visible
from dextron_bench.world import model

CONFIG = "search.json"  # In the folder of a data set: its config (under "search") and the hash of the physics.
REMEDY = "remove it, and run the same `dextron-bench success data` again"
TEST_EVERY = 5  # One setting in five is for testing, with all of its episodes: 80 % and 20 % (paper, II.E).


class Dataset:
    """The transitions of the training episodes in a folder, or of its test episodes, counted from 0.

    All episodes of a setting are on one side, since a model that knows a setting knows how its other episodes end.
    """

    def __init__(self, folder: Path, test: bool = False) -> None:
        """Opens the training episodes, or with `test` the test episodes. Raises NotFound, BadInput."""
        files = visible(folder / "blocks", "[0-9]*.safetensors")
        if not files:
            raise NotFound(f"{folder} holds no data set; make one with `dextron-bench success data`")
        if gaps := [number for number, file in enumerate(files) if int(file.stem) != number]:
            raise BadInput(f"{folder} lacks block {gaps[0]:06d}; run the same `dextron-bench success data` again")
        self._files, self._blocks = files, [open_block(file) for file in files]
        if len(np.unique(np.concatenate([block["solved"] for block in self._blocks]))) < 2:
            raise BadInput(
                f"all episodes in {folder} have the same outcome, so there is nothing to learn from them; "
                "run `dextron-bench success data` with more --rows"
            )
        is_test = _held_out([block["states"][block["starts"][:-1]] for block in self._blocks])
        if test and not any(mask.any() for mask in is_test):
            raise BadInput(
                f"the episodes in {folder} have fewer than {TEST_EVERY} settings, so none can be held out; "
                "run `dextron-bench success data` with more --rows"
            )
        pairs = [(block, mask == test) for block, mask in zip(self._blocks, is_test, strict=True)]
        self._block_numbers = np.repeat(np.arange(len(files)), [mask.sum() for _, mask in pairs])
        self._first_rows = np.concatenate([block["starts"][:-1][mask] for block, mask in pairs])
        self._solved = np.concatenate([block["solved"][mask] for block, mask in pairs])
        self._ends = np.cumsum(np.concatenate([np.diff(block["starts"])[mask] for block, mask in pairs]))

    def __len__(self) -> int:
        return int(self._ends[-1])

    def take(self, transitions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States (B, 48) and actions (B,) as float32, and outcomes (B,), 1 for success, of transitions (B,).

        Raises BadInput if a state or an action is not finite.
        """
        episodes = np.searchsorted(self._ends, transitions, side="right")
        steps = transitions - np.append(0, self._ends)[episodes]
        rows, numbers = self._first_rows[episodes] + steps, self._block_numbers[episodes]
        states, actions = np.empty((len(rows), model.STATE), np.float32), np.empty(len(rows), np.float32)
        for number in np.unique(numbers):
            in_block = numbers == number
            states[in_block] = self._blocks[number]["states"][rows[in_block]]
            actions[in_block] = self._blocks[number]["actions"][rows[in_block]]
        if (bad := ~(np.isfinite(states).all(axis=1) & np.isfinite(actions))).any():
            raise _damaged(self._files[numbers[bad][0]], "holds numbers that are not finite")
        return states, actions, self._solved[episodes].astype(np.int64)


def _held_out(first_states: Sequence[np.ndarray]) -> list[np.ndarray]:
    """For the first states (E, 48) of the episodes of each block: which of them (E,) are for testing.

    Settings have different first states. They count in the order in which they appear, so later blocks change nothing.
    """
    states = np.concatenate(first_states)
    _, appears, setting = np.unique(states, axis=0, return_index=True, return_inverse=True)
    number = np.argsort(np.argsort(appears))[setting.reshape(-1)]
    ends = np.cumsum([len(block) for block in first_states])
    return np.split(number % TEST_EVERY == TEST_EVERY - 1, ends[:-1])


def open_block(file: Path) -> dict[str, np.ndarray]:
    """Arrays of a block, mapped from the disk: `states` (R, 48), `actions` (R,), `starts` (E + 1,), `solved` (E,).

    Raises BadInput, OSError.
    """
    try:
        arrays = tensors.memory_mapped(file)
        rows, episodes = len(arrays["actions"]), len(arrays["solved"])
        shapes = {"states": (rows, model.STATE), "actions": (rows,), "starts": (episodes + 1,), "solved": (episodes,)}
        if wrong := [name for name, shape in shapes.items() if arrays[name].shape != shape]:
            raise _damaged(file, f"has an array {wrong[0]!r} of the wrong shape {arrays[wrong[0]].shape}")
        tensors.check(file, arrays)
    except tensors.BadTensors as error:
        raise BadInput(f"{error}; {REMEDY}") from error
    except KeyError as error:
        raise _damaged(file, f"lacks {error}") from error
    return arrays


class DatasetConfig(records.Record, frozen=True):
    """What a data set was made with, and the hash of its physics."""

    search: dict[str, Any]
    physics: str


def read_config(folder: Path) -> DatasetConfig | None:
    """Config of the data set in a folder; None if the folder has no config. Raises DamagedFile."""
    file = folder / CONFIG
    return records.read(file, DatasetConfig) if file.exists() else None


def _damaged(file: Path, fault: str) -> BadInput:
    return BadInput(f"{file} {fault}; {REMEDY}")
