"""Plays an episode and shows every step, with the success model's predictions, while it is played."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Expert, ExpertAgent
from dextron_bench.methods.agents import Agent, Privileged
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.rows import Rows
from dextron_bench.success.network import GRID, SuccessModel
from dextron_bench.world.model import CONTROL_STEP


class Observer(Protocol):
    """Receives an episode while it is played."""

    def show(self, states: np.ndarray, actions: np.ndarray, predictions: StepPredictions) -> None:
        """Called after each step, with all states (T, 48), actions (T, 1) and predictions so far."""
        ...

    def close(self, actions: np.ndarray, predictions: StepPredictions, success: bool) -> None:
        """Called after the last step, with all actions (T, 1) and predictions, and the outcome."""
        ...


def play(
    agent: Agent, source: Source, row: Rows, model: SuccessModel, observer: Observer, speed: float = 1.0
) -> Episode:
    """Plays one row and shows it to an observer, `speed` times as fast as real time; 0 means without waiting."""
    case = row.case(0)
    duration = source.duration(case.setting) / CONTROL_STEP
    step_seconds = CONTROL_STEP / speed if speed else 0.0
    observed = _ObservedAgent(agent, case.expert, model, duration, observer, step_seconds)
    ((_, episode),) = rollout(observed, source, row, slots=1, threads=1)
    observer.close(episode.actions, observed.predictions, episode.success)
    return episode


class _ObservedAgent:
    """Plays one episode as an agent does, and shows every step to an observer."""

    def __init__(
        self,
        agent: Agent,
        expert: Expert,
        model: SuccessModel,
        duration: float,
        observer: Observer,
        step_seconds: float,
    ) -> None:
        self._agent, self._model, self._duration, self._observer = agent, model, duration, observer
        self._expert, self._expert_agent = expert, ExpertAgent()
        self._step_seconds, self._next_step = step_seconds, time.perf_counter()
        self._states, self._actions = list[np.ndarray](), list[np.ndarray]()
        self._curves, self._chances, self._expert_actions = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()

    @property
    def predictions(self) -> StepPredictions:
        """The predictions so far."""
        parts = self._curves, self._chances, self._expert_actions
        curves, chances, expert_actions = map(np.concatenate, parts)
        return StepPredictions(GRID, curves, chances, expert_actions, self._duration)

    def assign(self, episodes: np.ndarray, experts: Sequence[Expert]) -> None:
        """Passes the experts on to an agent that wants them."""
        if isinstance(self._agent, Privileged):
            self._agent.assign(episodes, experts)

    def reset(self, episodes: np.ndarray) -> None:
        """Starts the episode."""
        self._agent.reset(episodes)
        self._expert_agent.assign(episodes, [self._expert])
        self._expert_agent.reset(episodes)

    def act(self, states: np.ndarray) -> np.ndarray:
        """The agent's actions (1, 1), returned after they are shown and the time of the step has passed."""
        actions = self._agent.act(states)
        self._states.append(states)
        self._actions.append(actions)
        self._curves.append(self._model.curve(states))
        self._chances.append(self._model.chance(states, actions[:, 0]))
        self._expert_actions.append(self._expert_agent.act(states)[:, 0])
        self._observer.show(np.concatenate(self._states), np.concatenate(self._actions), self.predictions)
        self._next_step = max(self._next_step + self._step_seconds, time.perf_counter())
        time.sleep(max(self._next_step - time.perf_counter(), 0.0))
        return actions
