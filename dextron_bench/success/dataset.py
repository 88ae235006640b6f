"""Reading the data set in batches, straight from the disk: memory grows with its episodes, not with its transitions."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dextron_bench.storage import tensors
from dextron_bench.world import model

REMEDY = "remove it, and the same `dextron-bench success data` plays it again"
TEST_EVERY = 5  # Every so many episodes of a block one is for testing: 80 % and 20 %, by episode (paper, II.E).


class EmptyDataset(LookupError):
    """A folder that holds no blocks."""


class BadDataset(ValueError):
    """Blocks that are no data set to learn from."""


class Dataset:
    """The transitions of four in five of the episodes in a folder, or of the others; numbered from 0."""

    def __init__(self, folder: Path, test: bool = False) -> None:
        """Takes the episodes to learn from, or those for testing; raises EmptyDataset, BadDataset."""
        files = sorted((folder / "blocks").glob("[0-9]*.safetensors"))
        if not files:
            raise EmptyDataset(f"{folder} holds no data set; make one with `dextron-bench success data`")
        if lost := [number for number, file in enumerate(files) if int(file.stem) != number]:
            raise BadDataset(
                f"{folder} lacks block {lost[0]:06d}; the same `dextron-bench success data` plays it again"
            )
        self._files, self._blocks = files, [open_block(file) for file in files]
        if len(np.unique(np.concatenate([each["solved"] for each in self._blocks]))) < 2:
            raise BadDataset(
                f"all episodes in {folder} end alike, which teaches nothing; `success data` with more --rows"
            )
        chosen = [np.arange(len(block["solved"])) % TEST_EVERY == TEST_EVERY - 1 for block in self._blocks]
        chosen = [held == test for held in chosen]
        pairs = list(zip(self._blocks, chosen, strict=True))
        self._of = np.repeat(np.arange(len(files)), [mine.sum() for mine in chosen])
        self._begins = np.concatenate([block["starts"][:-1][mine] for block, mine in pairs])
        self._solved = np.concatenate([block["solved"][mine] for block, mine in pairs])
        self._ends = np.cumsum(np.concatenate([np.diff(block["starts"])[mine] for block, mine in pairs]))

    def __len__(self) -> int:
        return int(self._ends[-1])

    def take(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States (B, 48), actions (B,), float32, and outcomes (B,), 1 for success, of transitions `places` (B,)."""
        episodes = np.searchsorted(self._ends, places, side="right")
        firsts = np.append(0, self._ends)[episodes]
        rows, of = self._begins[episodes] + places - firsts, self._of[episodes]
        states, actions = np.empty((len(places), model.STATE), np.float32), np.empty(len(places), np.float32)
        for number in np.unique(of):
            mine = of == number
            states[mine] = self._blocks[number]["states"][rows[mine]]
            actions[mine] = self._blocks[number]["actions"][rows[mine]]
        if (wrong := ~(np.isfinite(states).all(axis=1) & np.isfinite(actions))).any():
            raise _damaged(self._files[of[wrong][0]], "holds numbers that are not finite")
        return states, actions, self._solved[episodes].astype(np.int64)


def open_block(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a block, left on the disk: `states` (R, 48), `actions` (R,), `starts` (E + 1,) and `solved` (E,).

    Raises BadDataset, OSError.
    """
    try:
        arrays = tensors.mapped(file)
        rows, episodes = len(arrays["actions"]), len(arrays["solved"])
        shapes = {"states": (rows, model.STATE), "actions": (rows,), "starts": (episodes + 1,), "solved": (episodes,)}
        if other := [name for name, shape in shapes.items() if arrays[name].shape != shape]:
            raise _damaged(file, f"has {other[0]!r} of another length")
    except tensors.BadTensors as error:
        raise BadDataset(f"{error}; {REMEDY}") from error
    except KeyError as error:
        raise _damaged(file, f"lacks {error}") from error
    return arrays


def _damaged(file: Path, what: str) -> BadDataset:
    return BadDataset(f"{file} {what}; {REMEDY}")
