"""The learner of the tutorial trains, and a resumed training equals an unbroken one."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from dextron_bench import TrainingSetup, load_split, open_source
from dextron_bench.storage import hashing
from dextron_bench.world import task

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The tutorial's module."""
    monkeypatch.syspath_prepend(TUTORIALS)
    return import_module("search")


@pytest.fixture
def training_setup(tmp_path: Path) -> TrainingSetup:
    """A few cases of minimum-jerk reaches."""
    return TrainingSetup(open_source("minjerk"), load_split("minjerk", "val").cases[:4], tmp_path, threads=1)


@pytest.mark.slow
def test_a_resumed_training_equals_an_unbroken_one(search: ModuleType, training_setup: TrainingSetup):
    method = search.Search(preset="smoke", candidates=4, episodes=1)
    unbroken, first, second = (method.trainer(training_setup, [0]) for _ in range(3))
    metrics = [unbroken.advance(), unbroken.advance()]
    assert first.advance() == metrics[0]
    second.restore(first.state(), [first.journal()])
    assert second.epoch == 1
    assert second.advance() == metrics[1]
    for one, other in zip(unbroken.weights(), second.weights(), strict=True):
        np.testing.assert_array_equal(one["mean"], other["mean"])


def test_the_policy_opens_far_away_and_closes_near(search: ModuleType):
    agent = search.Linear(np.array([1.0, -2.0, 0.0]))
    states = np.zeros((2, 48))
    states[:, 10] = 1.0  # The palm's quaternion: no rotation.
    states[1, 0] = 1.0  # The bottle of the second row is a metre away.
    np.testing.assert_array_equal(agent.act(states)[1], [-1.0])


def test_settings_other_than_the_defaults_have_another_label(search: ModuleType):
    labels = {search.Search().label, search.Search(preset="smoke").label, search.Search(candidates=8).label}
    assert len(labels) == 3


@pytest.fixture
def my_agent(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The improved agent of the other tutorial."""
    monkeypatch.syspath_prepend(TUTORIALS)
    return import_module("my_agent")


def test_a_hand_that_was_fast_closes_farther_away_and_a_new_episode_forgets_it(my_agent: ModuleType):
    """With `near` 0.05 m and `lead` 0.1 s, a hand that came at 0.5 m/s closes within 0.1 m."""
    agent = my_agent.MyAgent(near=0.05, lead=0.1).agent(seed=0)
    agent.reset(np.arange(2))
    states = np.zeros((2, 48))
    states[:, 10] = 1.0  # The palm's quaternion: no rotation.
    start = task.palm_centre(states)[0, :2]
    states[:, :2] = np.add(start, (0.0, 0.3))  # The bottle is 0.3 m away from the palm's centre.
    states[0, 31] = 0.5
    np.testing.assert_array_equal(agent.act(states), [[-1.0], [-1.0]])
    states[:, :2], states[0, 31] = np.add(start, (0.0, 0.08)), 0.0
    np.testing.assert_array_equal(agent.act(states), [[1.0], [-1.0]])
    agent.reset(np.array([0]))
    np.testing.assert_array_equal(agent.act(states), [[-1.0], [-1.0]])


def test_the_tutorial_names_the_run_after_the_hash_of_the_agents_file(my_agent: ModuleType):
    digest = hashing.sha256(TUTORIALS / "my_agent.py")[:8]
    labels = set(re.findall(r"my-agent\+([0-9a-f]{8})", (TUTORIALS / "write-and-submit-an-agent.md").read_text()))
    assert labels == {digest}
