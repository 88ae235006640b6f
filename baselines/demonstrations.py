"""Expert episodes: played once, stored in a cache, and streamed in an order that each seed draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from baselines.replay import Transitions
from dextron_bench import Case, ExpertAgent, Track, rollout
from dextron_bench.storage import atomic, hashing, tensors
from dextron_bench.world import model

FORMAT = 1  # Version of the cached file.


@dataclass(frozen=True, slots=True)
class Demonstrations:
    """Episodes of experts, one after the other: states (R, 48), actions (R,), rewards (R,), float32.

    Episode k has the rows from `starts[k]` to `starts[k + 1]`; its last row holds only its last state. No expert lets
    the bottle fall, so no demonstration terminates.
    """

    states: np.ndarray
    actions: np.ndarray
    rewards: np.ndarray
    starts: np.ndarray

    def __len__(self) -> int:
        return len(self.starts) - 1

    def transitions(self) -> np.ndarray:
        """The rows (n,) that begin a transition, in order."""
        return np.delete(np.arange(len(self.states)), self.starts[1:] - 1)

    def at(self, rows: np.ndarray) -> Transitions:
        """The transitions that begin at rows (...), as `transitions` has them."""
        never = np.zeros(rows.shape, bool)
        return Transitions(self.states[rows], self.actions[rows], self.rewards[rows], self.states[rows + 1], never)

    def stream(self, rng: np.random.Generator, length: int) -> np.ndarray:
        """Rows (length,) that begin a transition, from whole episodes that are drawn with replacement."""
        steps = np.diff(self.starts) - 1
        drawn = rng.integers(len(self), size=length // int(steps.min()) + 1)
        ends = steps[drawn].cumsum()
        drawn = drawn[: np.searchsorted(ends, length) + 1]
        begins = np.repeat(self.starts[drawn] - np.append(0, steps[drawn].cumsum()[:-1]), steps[drawn])
        return (begins + np.arange(len(begins)))[:length].astype(np.int32)


def load(track: Track, episodes: int | None = None) -> Demonstrations:
    """The experts' episodes on the first `episodes` cases of a track (default: all), played or from the cache.

    Raises DamagedFile.
    """
    cases = track.cases[:episodes]
    file = track.cache / f"demonstrations-{_digest(cases)[:16]}.safetensors"
    if not file.exists():
        tensors.write(file, play(track, cases), {})
    return _stored(file, len(cases))


def _stored(file: Path, episodes: int) -> Demonstrations:
    """The episodes in a file of the cache; raises DamagedFile."""
    try:
        arrays = tensors.read(file)
    except tensors.BadTensors as error:
        raise atomic.DamagedFile(file, error) from error
    rows = len(arrays["states"]) if "states" in arrays else 0
    shapes = {"states": (rows, model.STATE), "actions": (rows,), "rewards": (rows,), "starts": (episodes + 1,)}
    if {name: array.shape for name, array in arrays.items()} != shapes or arrays["starts"][-1] != rows:
        raise atomic.DamagedFile(file, f"it does not hold {episodes} episodes")
    return Demonstrations(**arrays)


def play(track: Track, cases: Sequence[Case]) -> dict[str, np.ndarray]:
    """The arrays of `Demonstrations`, from rollouts of each case's expert."""
    played = dict(rollout(ExpertAgent(), track.source, cases, threads=track.threads))
    episodes = [played[k] for k in range(len(cases))]
    lengths = [len(episode.states) for episode in episodes]
    return {
        "states": np.concatenate([episode.states for episode in episodes]).astype(np.float32),
        "actions": np.concatenate([np.append(episode.actions[:, 0], 0.0) for episode in episodes]).astype(np.float32),
        "rewards": np.concatenate([np.append(episode.rewards, 0.0) for episode in episodes]).astype(np.float32),
        "starts": np.concatenate([[0], np.cumsum(lengths)]),
    }


def _digest(cases: Sequence[Case]) -> str:
    """SHA-256 of everything that the episodes depend on."""
    return hashing.digest(f"{FORMAT} {model.mjcf_hash()}".encode(), *(repr(case).encode() for case in cases))
