"""STOPPING: learns when to close, as a problem of optimal stopping; the hand opens until then, and never reopens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import ClassVar, Literal, Self

import numpy as np

from baselines import expert_windows, generated_reaches, openings, pose_features, stopping_trainer
from baselines.normalise import CLIP
from baselines.stopping_trainer import EDGE
from dextron_bench import Perceptron, Setting, Trainer, TrainingSetup
from dextron_bench.errors import BadInput
from dextron_bench.experts.openings import EVERY, NEAR, SUCCEEDS, OpeningSteps
from dextron_bench.methods.exact import rounded
from dextron_bench.world import task

NEARBY = 5  # Chosen on `val` and on settings that are drawn like the rows of `hard` (docs/baselines.md).


@dataclass(frozen=True)
class Stopping:
    """Opens, closes when small networks say so, and never reopens; learns from closings that were tried in simulation.

    Training needs a simulator that can be copied, because every decision of a setting of `train` is tried, or the
    windows of the experts alone (`--labels windows`). An agent sees the states of its episode alone.
    """

    name: ClassVar[str] = "stopping"
    train_source: ClassVar[str] = ""

    settings: int = 0
    """Number of settings of `train` to learn from; 0 takes all."""

    nearby: int = NEARBY
    """Number of settings to try near each setting that the rule of thumb fails."""

    generated: int = 0
    """Number of settings on new reaches, from a model that is fitted to the reaches of `train`."""

    labels: Literal["forks", "windows"] = "forks"
    """When closing works: as tried in forks, or by the windows of the experts, which know only settings of `train`."""

    def __post_init__(self) -> None:
        if self.settings < 0:
            raise BadInput(f"--settings is {self.settings}; give how many to learn from, or 0 for all")
        if self.nearby < 0:
            raise BadInput(f"--nearby is {self.nearby}; give how many to try near each setting, or 0 for none")
        if self.generated < 0:
            raise BadInput(f"--generated is {self.generated}; give how many to try on new reaches, or 0 for none")
        if self.labels == "windows" and (self.nearby != NEARBY or self.generated):
            raise BadInput("--labels windows knows only settings of `train`; leave out --nearby and --generated")

    @property
    def label(self) -> str:
        """The name, with the numbers of settings that are not the defaults."""
        limit = f"-{self.settings}" if self.settings else ""
        nearby = f"-nearby{self.nearby}" if self.nearby != NEARBY else ""
        windows = "-windows" if self.labels == "windows" else ""
        return self.name + windows + limit + nearby + (f"-generated{self.generated}" if self.generated else "")

    @property
    def epochs(self) -> int:
        """Number of epochs of the training."""
        return stopping_trainer.EPOCHS

    @property
    def period(self) -> int:
        """Epochs between checkpoints."""
        return 3

    @property
    def timing_run(self) -> Self:
        """The training itself, which takes minutes."""
        return self

    def trainer(self, setup: TrainingSetup, seeds: Sequence[int]) -> Trainer:
        """A trainer with several networks per seed, all trained together."""
        episodes = self._by_forks(setup) if self.labels == "forks" else self._by_windows(setup)
        return stopping_trainer.StoppingTrainer(stopping_trainer.Decisions(episodes, setup.device), seeds, setup.device)

    def _by_windows(self, setup: TrainingSetup) -> list[OpeningSteps]:
        """The openings of settings, with labels from the windows of their experts."""
        cases = list({case.setting: case for case in setup.cases}.values())
        return expert_windows.play(setup, cases[: self.settings or len(cases)])

    def _by_forks(self, setup: TrainingSetup) -> list[OpeningSteps]:
        """The openings of settings, of settings near them and of generated ones, with labels that were tried."""
        settings = openings.settings_of(setup)
        played = openings.load(setup, settings)  # All of them, so that all numbers of settings share the files.
        near = self._nearby(setup, settings, played)
        count = self.settings or len(settings)
        return [*played[:count], *chain.from_iterable(near[:count]), *self._generated(setup, settings[:count])]

    def _nearby(
        self, setup: TrainingSetup, settings: Sequence[Setting], played: Sequence[OpeningSteps]
    ) -> list[list[OpeningSteps]]:
        """For each setting (with its opening `played`) that the rule fails, openings near it that closing can solve."""
        failed = [row for row, episode in enumerate(played) if not openings.rule_succeeds(episode, EDGE)]
        near = openings.load_nearby(setup, [settings[row] for row in failed], self.nearby)
        solvable: list[list[OpeningSteps]] = [[] for _ in settings]
        for row, episodes in zip(failed, near, strict=True):
            solvable[row] = [episode for episode in episodes if (episode[1] == SUCCEEDS).any()]
        return solvable

    def _generated(self, setup: TrainingSetup, settings: Sequence[Setting]) -> list[OpeningSteps]:
        """The openings on reaches that are generated from the reaches of settings, if closing can succeed."""
        if not self.generated:
            return []
        source, new = generated_reaches.generate(setup.source, settings, self.generated)
        played = openings.load(replace(setup, source=source), new)
        return [episode for episode in played if (episode[1] == SUCCEEDS).any()]

    def policy(self, weights: Mapping[str, np.ndarray]) -> StoppingAgent:
        """The agent that closes when the mean output of its networks is positive."""
        return StoppingAgent(weights)


class StoppingAgent:
    """Opens until the mean of its networks' outputs is positive at a decision, then closes for good."""

    def __init__(self, weights: Mapping[str, np.ndarray]) -> None:
        """Takes `mean` and `deviation` (F,) of features, and layers `network.0`, ... and `ramp` of M networks."""
        self._mean, self._deviation, self._ramp = (
            np.asarray(weights[name], np.float64) for name in ("mean", "deviation", "ramp")
        )
        layers = [weights[f"network.{i}"] for i in range(6)]
        members = [[layer[member] for layer in layers] for member in range(len(self._ramp))]
        self._networks = [Perceptron(list(zip(one[::2], one[1::2], strict=True))) for one in members]
        self._history = pose_features.History()
        self._closes, self._since_near = np.zeros(0, bool), np.zeros(0, int)

    def reset(self, episodes: np.ndarray) -> None:
        """Rows `episodes` (n,) begin a new episode, with an opening hand."""
        self._history.reset(episodes)
        missing = max(0, int(episodes.max(initial=-1)) + 1 - len(self._closes))
        self._closes, self._since_near = (np.pad(array, (0, missing)) for array in (self._closes, self._since_near))
        self._closes[episodes], self._since_near[episodes] = False, -1

    def act(self, states: np.ndarray) -> np.ndarray:
        """Actions (N, 1), -1 or 1, for states (N, 48)."""
        n = len(states)
        self._history.add(states)
        self._since_near[:n] += (self._since_near[:n] >= 0) | (task.distance(states) < NEAR)
        decides = (self._since_near[:n] >= 0) & (self._since_near[:n] % EVERY == 0) & ~self._closes[:n]
        rows = np.flatnonzero(decides)
        if rows.size:
            self._closes[rows] = self._closing(self._history.features(rows)) > 0.0
        return np.where(self._closes[:n], 1.0, -1.0)[:, None]

    def _closing(self, features: np.ndarray) -> np.ndarray:
        """The mean logits (n,) of closing for features (n, F)."""
        scaled = np.clip((features - self._mean) / self._deviation, -CLIP, CLIP)
        distance = features[:, pose_features.DISTANCE]
        logits = [
            network(scaled)[:, 0] + steepness * (edge - distance)
            for network, (edge, steepness) in zip(self._networks, self._ramp, strict=True)
        ]
        return rounded(np.mean(logits, axis=0))
