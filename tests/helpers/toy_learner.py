"""Small learners in NumPy: they fit a linear map to their experience, and depend on all of it."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from dextron_bench.methods.agents import Agent
from dextron_bench.methods.learners import Arrays, Trainer, TrainingSetup
from dextron_bench.world import model

EPOCHS = {"paper": 12, "quick": 5, "smoke": 2}
FRAMES = 20  # Per epoch.
WORD = (1 << 64) - 1  # Mask of 64 bits.


class BadRate(ValueError):
    """A learning rate that is not positive."""


@dataclass(frozen=True)
class Toy:
    """Fits a linear map to the actions of a synthetic expert."""

    name: ClassVar[str] = "toy"
    train_source: ClassVar[str] = ""

    rate: float = 0.1
    """Learning rate."""
    preset: Literal["paper", "quick", "smoke"] = "paper"
    """How long to train."""
    every: int = 2
    """Epochs between checkpoints."""
    spoils: int = 0
    """From this epoch on, the loss of the last seed is NaN; 0 means never."""
    breaks: int = 0
    """This epoch raises an exception; 0 means never."""
    wait: float = 0.0
    """Minimum time of an epoch [s]."""

    def __post_init__(self) -> None:
        if self.rate <= 0.0:
            raise BadRate(f"--rate is {self.rate:g}; a learning rate is positive")

    @property
    def label(self) -> str:
        """The name and the learning rate."""
        return f"{self.name}-{self.rate:g}"

    @property
    def epochs(self) -> int:
        """Number of epochs of the training."""
        return EPOCHS[self.preset]

    @property
    def period(self) -> int:
        """Epochs between checkpoints."""
        return self.every

    @property
    def timing_run(self) -> Toy:
        """The same learner with the shortest preset."""
        return replace(self, preset="smoke")

    def trainer(self, setup: TrainingSetup, seeds: Sequence[int]) -> Trainer:
        """A new trainer."""
        return ToyTrainer(self, len(setup.cases), seeds)

    def policy(self, weights: Mapping[str, np.ndarray]) -> Agent:
        """The agent that plays the map."""
        return Linear(weights["map"], weights["offset"])


@dataclass(frozen=True)
class MinjerkToy(Toy):
    """Always trains on minimum-jerk reaches."""

    name: ClassVar[str] = "minjerk-toy"
    train_source: ClassVar[str] = "minjerk"


@dataclass(frozen=True)
class ToyTransfer:
    """Plays the policy of MinjerkToy on other reaches."""

    name: ClassVar[str] = "toy-transfer"

    preset: Literal["paper", "quick", "smoke"] = "paper"
    """How long the source policy trains."""

    @property
    def label(self) -> str:
        """The name."""
        return self.name

    @property
    def source_policy(self) -> MinjerkToy:
        """The learner with the same preset."""
        return MinjerkToy(preset=self.preset)


class Linear:
    """Plays tanh(states map + offset)."""

    def __init__(self, weights: np.ndarray, offset: np.ndarray) -> None:
        self._map, self._offset = weights, float(offset)

    def reset(self, episodes: np.ndarray) -> None:
        """Does nothing: the agent has no memory."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Closing speeds (N, 1) for states (N, 48)."""
        return np.tanh(states @ self._map + self._offset)[:, None]


class ToyTrainer:
    """Trains one map per seed; each step draws a state from all experience of its seed."""

    def __init__(self, toy: Toy, cases: int, seeds: Sequence[int]) -> None:
        self._toy, self.epoch = toy, 0
        self._streams = [np.random.default_rng([seed, cases]) for seed in seeds]
        self._maps = np.zeros((len(seeds), model.STATE))
        self._offsets = np.zeros(len(seeds))
        self._experience: list[np.ndarray] = [np.zeros((0, model.STATE)) for _ in seeds]
        self._journaled = 0

    def advance(self) -> list[dict[str, float]]:
        """Adds FRAMES states to the experience and takes as many gradient steps."""
        self.epoch += 1
        time.sleep(self._toy.wait)
        if self.epoch == self._toy.breaks:
            raise ZeroDivisionError("toys break")
        metrics = [{"loss": self._train(k), "frames": float(self.epoch * FRAMES)} for k in range(len(self._streams))]
        if 0 < self._toy.spoils <= self.epoch:
            metrics[-1]["loss"] = float("nan")
        return metrics

    def _train(self, k: int) -> float:
        rng = self._streams[k]
        self._experience[k] = np.concatenate([self._experience[k], rng.standard_normal((FRAMES, model.STATE))])
        losses = []
        for _ in range(FRAMES):
            state = self._experience[k][rng.integers(len(self._experience[k]))]
            error = np.tanh(state @ self._maps[k] + self._offsets[k]) - np.tanh(state[7] + 0.5)
            self._maps[k] -= self._toy.rate * error * state / model.STATE
            self._offsets[k] -= self._toy.rate * error
            losses.append(error**2)
        return float(np.mean(losses))

    def weights(self) -> list[Arrays]:
        """Map (48,) and offset of each seed."""
        return [{"map": m.copy(), "offset": np.array(o)} for m, o in zip(self._maps, self._offsets, strict=True)]

    def state(self) -> Arrays:
        """Everything except the experience."""
        streams = np.array([pack(rng) for rng in self._streams])
        return {"maps": self._maps, "offsets": self._offsets, "streams": streams, "epoch": np.array(self.epoch)}

    def journal(self) -> Arrays:
        """Experience since the last journal."""
        recent = np.array([states[self._journaled :] for states in self._experience])
        self._journaled = len(self._experience[0])
        return {"experience": recent}

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Continues from another trainer's `state` and journals."""
        self._maps, self._offsets, self.epoch = state["maps"], state["offsets"], int(state["epoch"])
        for rng, words in zip(self._streams, state["streams"], strict=True):
            unpack(rng, words)
        parts = [journal["experience"] for journal in journals]
        self._experience = list(np.concatenate(parts, axis=1))
        self._journaled = len(self._experience[0])


def pack(rng: np.random.Generator) -> list[np.uint64]:
    """The state of a PCG64 stream in words of 64 bits."""
    state = rng.bit_generator.state
    numbers = [state["state"]["state"], state["state"]["inc"]]
    words = [part for number in numbers for part in (number >> 64, number & WORD)]
    return [np.uint64(word) for word in (*words, state["has_uint32"], state["uinteger"])]


def unpack(rng: np.random.Generator, words: np.ndarray) -> None:
    """Restores the state that `pack` returned."""
    a, b, c, d, has, left = map(int, words)
    state = {"state": a << 64 | b, "inc": c << 64 | d}
    rng.bit_generator.state = {"bit_generator": "PCG64", "state": state, "has_uint32": has, "uinteger": left}
