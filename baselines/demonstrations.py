"""Expert episodes: played once, stored in a cache, and streamed in an order that each seed draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from baselines.random_streams import DEMONSTRATIONS, generator
from baselines.replay import CAPACITY, Transitions
from dextron_bench import Case, Episode, ExpertAgent, TrainingSetup, rollout
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


@dataclass(frozen=True, slots=True)
class Streamed:
    """Demonstrations that each seed's expert plays beside its agent, one transition a frame: the paper's buffer."""

    episodes: Demonstrations
    rows: np.ndarray
    """The transition (S, frames) of each frame."""

    @classmethod
    def draw(cls, episodes: Demonstrations, seeds: Sequence[int], frames: int) -> Self:
        """Draws the order in which each seed's expert plays the episodes."""
        return cls(episodes, np.stack([episodes.stream(generator(seed, DEMONSTRATIONS), frames) for seed in seeds]))

    def select(self, uniform: np.ndarray, frames: int) -> Transitions:
        """The transitions (S, B) that numbers (S, B) in [0, 1) select from the ones of the first `frames` frames."""
        oldest = max(frames - CAPACITY, 0)
        place = oldest + (uniform * (frames - oldest)).astype(int)
        return self.episodes.at(self.rows[np.arange(len(self.rows))[:, None], place])


@dataclass(frozen=True, slots=True)
class Everything:
    """All demonstrations, from the first frame on."""

    episodes: Demonstrations
    rows: np.ndarray
    """The rows (n,) that begin a transition."""

    @classmethod
    def of(cls, episodes: Demonstrations) -> Self:
        """All transitions of the episodes."""
        return cls(episodes, episodes.transitions())

    def select(self, uniform: np.ndarray, frames: int) -> Transitions:
        """The transitions (S, B) that numbers (S, B) in [0, 1) select."""
        return self.episodes.at(self.rows[(uniform * len(self.rows)).astype(int)])


def load(setup: TrainingSetup, episodes: int | None = None) -> Demonstrations:
    """The experts' episodes on the first `episodes` cases of a training (default: all), played or from the cache.

    Raises DamagedFile.
    """
    cases = setup.cases[:episodes]
    file = setup.cache / f"demonstrations-{_digest(cases)[:16]}.safetensors"
    if not file.exists():
        tensors.write(file, play(setup, cases), {})
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


def play(setup: TrainingSetup, cases: Sequence[Case]) -> dict[str, np.ndarray]:
    """The arrays of `Demonstrations`, from rollouts of each case's expert."""
    played: dict[int, Episode] = {}
    for number, episode in rollout(ExpertAgent(), setup.source, cases, threads=setup.threads):
        played[number] = episode
        setup.report(len(played), len(cases), "expert episodes played")
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
