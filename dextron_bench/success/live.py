"""A policy at work, watched: its episode in the viewer as it is played, with what the success model thinks."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.methods.agents import Agent, Privileged
from dextron_bench.reaches.setting import Source
from dextron_bench.success.network import GRID, SuccessModel
from dextron_bench.world import model as world_model


class Observer(Protocol):
    """Is shown an episode so far after each step, and its end."""

    def show(self, states: np.ndarray, actions: np.ndarray, insight: StepPredictions) -> None:
        """States (T, 48) that the agent has seen, what it did in them (T, 1), and what is thought of it."""
        ...

    def close(self, actions: np.ndarray, insight: StepPredictions, success: bool) -> None:
        """All actions (T, 1) and thoughts, and the outcome."""
        ...


def play(
    agent: Agent, source: Source, case: Case, model: SuccessModel, audience: Observer, speed: float = 1.0
) -> Episode:
    """Plays an episode before an audience, `speed` times as fast as life; 0 waits for nothing."""
    duration = source.duration(case.setting) / world_model.CONTROL_STEP
    watched = _ObservedAgent(
        agent, case.expert, model, duration, audience, world_model.CONTROL_STEP / speed if speed else 0.0
    )
    ((_, episode),) = rollout(watched, source, [case], slots=1, threads=1)
    audience.close(episode.actions, watched.insight, episode.success)
    return episode


class _ObservedAgent:
    """An agent of one episode, whose every step is shown."""

    def __init__(
        self, agent: Agent, expert: Expert, model: SuccessModel, duration: float, audience: Observer, pace: float
    ) -> None:
        self._agent, self._model, self._duration, self._audience, self._pace = agent, model, duration, audience, pace
        self._expert, self._own = ExpertAgent(), expert
        self._states, self._actions = list[np.ndarray](), list[np.ndarray]()
        self._curves, self._chances, self._experts = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
        self._due = time.perf_counter()

    @property
    def insight(self) -> StepPredictions:
        """The thoughts so far."""
        curves, chances, experts = (np.concatenate(each) for each in (self._curves, self._chances, self._experts))
        return StepPredictions(GRID, curves, chances, experts, self._duration)

    def assign(self, episodes: np.ndarray, experts: Sequence[Expert]) -> None:
        """Tells the agent its expert where it asks for one."""
        if isinstance(self._agent, Privileged):
            self._agent.assign(episodes, experts)

    def reset(self, episodes: np.ndarray) -> None:
        """Begins the episode."""
        self._agent.reset(episodes)
        self._expert.assign(episodes, [self._own])
        self._expert.reset(episodes)

    def act(self, states: np.ndarray) -> np.ndarray:
        """What the agent does, once it was shown."""
        actions = self._agent.act(states)
        self._states.append(states)
        self._actions.append(actions)
        self._curves.append(self._model.curve(states))
        self._chances.append(self._model.chance(states, actions[:, 0]))
        self._experts.append(self._expert.act(states)[:, 0])
        self._audience.show(np.concatenate(self._states), np.concatenate(self._actions), self.insight)
        self._due = max(self._due + self._pace, time.perf_counter())
        time.sleep(max(self._due - time.perf_counter(), 0.0))
        return actions
