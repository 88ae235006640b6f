"""The batches of RL and RLIL, from a world whose rewards and ends are written down."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from baselines import cycle
from baselines.normalise import EPSILON
from baselines.random_streams import Draws
from baselines.sac import Batch
from baselines.schedule import Schedule
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.methods.learners import TrainingSetup
from dextron_bench.world.engine import Step
from tests.helpers.short_reaches import SETTINGS, SOURCE

REWARDS = (0.0, 4.0, 0.0, 0.0)
TRUNCATED, FELL = 2, 4  # Frames, from 1, with which the two episodes end.


class WrittenWorld:
    """Stands for the engine of one agent: two episodes of two steps; time ends the first, a fall the second."""

    def __init__(self, slots: int, threads: int) -> None:
        self.frame = 0

    def begin(self, slots: np.ndarray, paths: Sequence[Any]) -> np.ndarray:
        return np.zeros((len(slots), 48))

    def step(self, slots: np.ndarray, actions: np.ndarray) -> Step:
        self.frame += 1
        states, fell, truncated = np.full((1, 48), float(self.frame)), self.frame == FELL, self.frame == TRUNCATED
        flags = np.array([[fell], [truncated], [False]])
        return Step(states, np.array([REWARDS[self.frame - 1]]), *flags)


class Watcher:
    """An algorithm that keeps the last batch, whose numbers select every transition once, and learns nothing."""

    losses = ()
    policy: tuple[Tensor, ...] = ()

    def __init__(self, scales_rewards: bool) -> None:
        self.scales_rewards, self.networks, self.batch = scales_rewards, self, None

    def act(self, states: Tensor, noise: Tensor) -> Tensor:
        return noise

    def draw(self, draws: Draws) -> tuple[Any, ...]:
        return ()

    def update(self, batch: Callable[[np.ndarray], Batch], drawn: Sequence[Any]) -> Tensor:
        self.batch = batch((np.arange(len(REWARDS))[None] + 0.5) / len(REWARDS))
        return torch.zeros((0, 1))


def last_batch(folder: Path, monkeypatch: pytest.MonkeyPatch, scales_rewards: bool = True) -> Batch:
    """The batch of all transitions after the last frame."""
    monkeypatch.setattr(cycle, "FRAMES", len(REWARDS))
    monkeypatch.setattr(cycle, "Engine", WrittenWorld)
    setup = TrainingSetup(SOURCE, [Case(SETTINGS[0], Expert(1.2, 0.3), 0.1)], folder, threads=1)
    watcher: Any = Watcher(scales_rewards)
    cycle.Cycle(setup, [0], Schedule(1, 0, 1), lambda rngs, device: watcher).advance()
    return watcher.batch


def test_only_a_fall_ends_the_future_of_a_transition(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The value of the next state counts after the end of time: a truncated episode could have gone on."""
    batch = last_batch(tmp_path, monkeypatch)
    assert batch.alive[0, :, 0].tolist() == [1.0, 1.0, 1.0, 0.0]


def test_rewards_are_divided_by_their_deviation_so_far(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The rewards 0, 4, 0 and 0 have a mean of 1 and a variance of (9 + 1 + 1 + 1) / 4 = 3."""
    batch = last_batch(tmp_path, monkeypatch)
    expected = np.array(REWARDS) / np.sqrt(3.0 + EPSILON)
    np.testing.assert_allclose(batch.rewards[0, :, 0], expected, rtol=1e-3)


def test_an_algorithm_may_take_the_rewards_as_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    batch = last_batch(tmp_path, monkeypatch, scales_rewards=False)
    assert batch.rewards[0, :, 0].tolist() == list(REWARDS)
