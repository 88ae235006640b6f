"""Learners made of little numpy: they fit a linear map to experience that they keep, and depend on all they keep."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from dextron_bench.methods.agents import Agent
from dextron_bench.methods.learners import Arrays, Track, Trainer
from dextron_bench.world import model

EPOCHS = {"paper": 12, "quick": 5, "smoke": 2}
FRAMES = 20  # In an epoch.
WORD = (1 << 64) - 1


class BadRate(ValueError):
    """A learning rate that is not positive."""


@dataclass(frozen=True)
class Toy:
    """Fits a linear map to what a made-up expert did."""

    name: ClassVar[str] = "toy"
    train_source: ClassVar[str] = ""

    rate: float = 0.1
    """Learning rate."""
    preset: Literal["paper", "quick", "smoke"] = "paper"
    """How long to train."""
    every: int = 2
    """Epochs between checkpoints."""
    spoils: int = 0
    """Epoch from which the loss of the second seed is not a number; 0 is never."""
    breaks: int = 0
    """Epoch that raises; 0 is never."""
    wait: float = 0.0
    """Time that an epoch takes at least [s]."""

    def __post_init__(self) -> None:
        if self.rate <= 0.0:
            raise BadRate(f"--rate is {self.rate:g}; a learning rate is positive")

    @property
    def label(self) -> str:
        """Tells rates apart."""
        return f"{self.name}-{self.rate:g}"

    @property
    def epochs(self) -> int:
        """How many there are."""
        return EPOCHS[self.preset]

    @property
    def period(self) -> int:
        """Epochs between checkpoints."""
        return self.every

    @property
    def timing_run(self) -> Toy:
        """Itself in short."""
        return replace(self, preset="smoke")

    def trainer(self, track: Track, seeds: Sequence[int]) -> Trainer:
        """At its start."""
        return ToyTrainer(self, len(track.cases), seeds)

    def policy(self, weights: Mapping[str, np.ndarray]) -> Agent:
        """Plays the map."""
        return Linear(weights["map"], weights["offset"])


@dataclass(frozen=True)
class Homely(Toy):
    """Trains where minimum-jerk reaches are."""

    name: ClassVar[str] = "homely"
    train_source: ClassVar[str] = "minjerk"


@dataclass(frozen=True)
class ToyTransfer:
    """Takes what Homely learned to other reaches."""

    name: ClassVar[str] = "toy-heir"

    preset: Literal["paper", "quick", "smoke"] = "paper"
    """How long the source_policy trains."""

    @property
    def label(self) -> str:
        """As the name."""
        return self.name

    @property
    def source_policy(self) -> Homely:
        """Whose policy it is."""
        return Homely(preset=self.preset)


class Linear:
    """Plays tanh(states map + offset)."""

    def __init__(self, weights: np.ndarray, offset: np.ndarray) -> None:
        self._map, self._offset = weights, float(offset)

    def reset(self, episodes: np.ndarray) -> None:
        """Has no memory."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Closing speeds (N, 1) for states (N, 48)."""
        return np.tanh(states @ self._map + self._offset)[:, None]


class ToyTrainer:
    """One map and one stream of random numbers a seed; experience grows, and is drawn from."""

    def __init__(self, toy: Toy, cases: int, seeds: Sequence[int]) -> None:
        self._toy, self.epoch = toy, 0
        self._streams = [np.random.default_rng([seed, cases]) for seed in seeds]
        self._maps = np.zeros((len(seeds), model.STATE))
        self._offsets = np.zeros(len(seeds))
        self._lived: list[np.ndarray] = [np.zeros((0, model.STATE)) for _ in seeds]
        self._journaled = 0

    def advance(self) -> list[dict[str, float]]:
        """Lives FRAMES states more and takes as many steps downhill on ones drawn from all lived."""
        self.epoch += 1
        time.sleep(self._toy.wait)
        if self.epoch == self._toy.breaks:
            raise ZeroDivisionError("toys break")
        noted = [{"loss": self._learn(k), "frames": float(self.epoch * FRAMES)} for k in range(len(self._streams))]
        if 0 < self._toy.spoils <= self.epoch:
            noted[-1]["loss"] = float("nan")
        return noted

    def _learn(self, k: int) -> float:
        rng = self._streams[k]
        self._lived[k] = np.concatenate([self._lived[k], rng.standard_normal((FRAMES, model.STATE))])
        losses = []
        for _ in range(FRAMES):
            state = self._lived[k][rng.integers(len(self._lived[k]))]
            error = np.tanh(state @ self._maps[k] + self._offsets[k]) - np.tanh(state[7] + 0.5)
            self._maps[k] -= self._toy.rate * error * state / model.STATE
            self._offsets[k] -= self._toy.rate * error
            losses.append(error**2)
        return float(np.mean(losses))

    def weights(self) -> list[Arrays]:
        """Map (48,) and offset."""
        return [{"map": m.copy(), "offset": np.array(o)} for m, o in zip(self._maps, self._offsets, strict=True)]

    def state(self) -> Arrays:
        """All but experience."""
        streams = np.array([packed(rng) for rng in self._streams])
        return {"maps": self._maps, "offsets": self._offsets, "streams": streams, "epoch": np.array(self.epoch)}

    def journal(self) -> Arrays:
        """Experience since the last journal."""
        fresh = np.array([lived[self._journaled :] for lived in self._lived])
        self._journaled = len(self._lived[0])
        return {"lived": fresh}

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Takes the place of the trainer that gave these."""
        self._maps, self._offsets, self.epoch = state["maps"], state["offsets"], int(state["epoch"])
        for rng, words in zip(self._streams, state["streams"], strict=True):
            unpack(rng, words)
        parts = [each["lived"] for each in journals]
        self._lived = list(np.concatenate(parts, axis=1))
        self._journaled = len(self._lived[0])


def packed(rng: np.random.Generator) -> list[np.uint64]:
    """The state of a PCG64 stream in words of 64 bits."""
    found = rng.bit_generator.state
    big = [found["state"]["state"], found["state"]["inc"]]
    words = [part for number in big for part in (number >> 64, number & WORD)]
    return [np.uint64(word) for word in (*words, found["has_uint32"], found["uinteger"])]


def unpack(rng: np.random.Generator, words: np.ndarray) -> None:
    """Puts a stream where `packed` found one."""
    a, b, c, d, has, left = map(int, words)
    state = {"state": a << 64 | b, "inc": c << 64 | d}
    rng.bit_generator.state = {"bit_generator": "PCG64", "state": state, "has_uint32": has, "uinteger": left}
