"""A small method that learns: a cross-entropy search for the three numbers of a linear policy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

import dextron_bench as bench
from dextron_bench.world import task

EPOCHS = {"full": 10, "smoke": 2}
ELITE = 4  # The best candidates of an epoch, from which the next epoch starts.

Arrays = dict[str, np.ndarray]


class Linear:
    """Closes at a speed that is linear in the distance to the bottle and in the closure of the hand."""

    def __init__(self, weights: np.ndarray) -> None:
        """Takes the bias, the weight of the distance [1/dm], and the weight of the closure."""
        self._bias, self._distance, self._closure = weights

    def reset(self, episodes: np.ndarray) -> None:
        """Does nothing: the policy has no memory."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Maps states (N, 48) to closing speeds (N, 1) in [-1, 1]."""
        speeds = self._bias + self._distance * task.distance(states) / 0.1 + self._closure * task.closure(states)
        return np.clip(speeds, -1.0, 1.0)[:, None]


@dataclass(frozen=True)
class Search:
    """The method. Its fields are flags of `dextron-bench run`."""

    name: ClassVar[str] = "search"
    train_source: ClassVar[str] = ""  # Empty: it trains on the reaches of the run.

    preset: Literal["full", "smoke"] = "full"
    """How long to train."""
    candidates: int = 16
    """Policies to try in each epoch."""
    episodes: int = 32
    """Episodes that each candidate plays."""

    @property
    def label(self) -> str:
        """The name of its runs; it distinguishes settings."""
        size = "" if (self.candidates, self.episodes) == (16, 32) else f"-{self.candidates}x{self.episodes}"
        return self.name + size + ("" if self.preset == "full" else f"-{self.preset}")

    @property
    def epochs(self) -> int:
        """Epochs of the training."""
        return EPOCHS[self.preset]

    @property
    def period(self) -> int:
        """Epochs between two checkpoints."""
        return 1

    @property
    def timing_run(self) -> Search:
        """A short training from which the harness estimates the time of a long one."""
        return replace(self, preset="smoke")

    def trainer(self, setup: bench.TrainingSetup, seeds: Sequence[int]) -> SearchTrainer:
        """A trainer with 0 epochs done."""
        return SearchTrainer(self, setup, seeds)

    def policy(self, weights: Mapping[str, np.ndarray]) -> Linear:
        """The agent of one seed's weights."""
        return Linear(weights["mean"])


class SearchTrainer:
    """The searches of S seeds: a mean and a spread of weights for each, (S, 3)."""

    def __init__(self, search: Search, setup: bench.TrainingSetup, seeds: Sequence[int]) -> None:
        """Starts from no knowledge: mean 0, spread 2."""
        self.epoch = 0
        self._search, self._setup, self._seeds = search, setup, seeds
        self._mean, self._spread = np.zeros((len(seeds), 3)), np.full((len(seeds), 3), 2.0)
        self._frames = np.zeros(len(seeds))

    def advance(self) -> list[dict[str, float]]:
        """Trains for one epoch; returns the metrics of each seed."""
        metrics = [self._improve(k) for k in range(len(self._seeds))]
        self.epoch += 1
        return metrics

    def _improve(self, k: int) -> dict[str, float]:
        """Plays random candidates of seed k on random cases, and moves towards the best."""
        rng = np.random.default_rng([self._seeds[k], self.epoch])  # A resumed training draws the same numbers.
        rows = rng.choice(len(self._setup.cases), self._search.episodes, replace=False)
        cases = [self._setup.cases[row] for row in rows]
        candidates = rng.normal(self._mean[k], self._spread[k], (self._search.candidates, 3))
        returns = np.array([self._play(k, weights, cases) for weights in candidates])
        elite = candidates[np.argsort(returns)[-ELITE:]]
        self._mean[k], self._spread[k] = elite.mean(axis=0), elite.std(axis=0) + 0.1
        return {"best_return": float(returns.max()), "frames": float(self._frames[k])}

    def _play(self, k: int, weights: np.ndarray, cases: Sequence[bench.Case]) -> float:
        """The mean return of a candidate."""
        played = bench.rollout(Linear(weights), self._setup.source, cases, threads=self._setup.threads)
        episodes = [episode for _, episode in played]
        self._frames[k] += sum(len(episode.actions) for episode in episodes)
        return float(np.mean([episode.score for episode in episodes]))

    def weights(self) -> list[Arrays]:
        """What `Search.policy` needs, for each seed."""
        return [{"mean": mean.copy()} for mean in self._mean]

    def state(self) -> Arrays:
        """Everything that the next epoch depends on."""
        return {"mean": self._mean, "spread": self._spread, "frames": self._frames, "epoch": np.array([self.epoch])}

    def journal(self) -> Arrays:
        """Nothing: the search keeps no experience from epoch to epoch."""
        return {}

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Continues from the state of another trainer."""
        self._mean, self._spread, self._frames = (state[name].copy() for name in ("mean", "spread", "frames"))
        self.epoch = int(state["epoch"][0])
