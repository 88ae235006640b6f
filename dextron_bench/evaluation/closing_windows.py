"""When closing works on a setting, and when agents close there: what the figure of windows shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dextron_bench.evaluation.diagnosis import closing_start
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import openings
from dextron_bench.experts.openings import NO_DECISION, SUCCEEDS
from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Source
from dextron_bench.reaches.timing import CONTROL_STEP
from dextron_bench.splits.rows import Rows
from dextron_bench.world import task


@dataclass(frozen=True, slots=True)
class Window:
    """When closing works on one setting, for a hand that opens at full speed until it closes at full speed.

    `times` (n,) [s] are the moments that were tried, from the start of the episode on: every second control step once
    the hand is within `openings.NEAR` of the bottle, and `works` (n,) says whether closing there scores 20.
    """

    times: np.ndarray
    works: np.ndarray


@dataclass(frozen=True, slots=True)
class Choice:
    """When an agent began to close [s], from the start of the episode, NaN if it never did; and if it scored 20."""

    time: float
    success: bool


def play_windows(source: Source, rows: Rows, threads: int = 0) -> list[Window]:
    """The window of each row, with the row's bottle: when closing must arrive, whatever delays it."""
    played = openings.play(source, [case.setting for case in rows.cases], threads, rows.bottles)
    return [_window(outcomes) for _, outcomes in played]


def play_choices(agent: Agent, source: Source, rows: Rows, threads: int = 0) -> list[Choice]:
    """The choice of an agent in each row; raises AgentError."""
    episodes = dict(rollout(agent, source, rows, threads=threads))
    return [choice(episodes[place]) for place in range(len(rows))]


def choice(episode: Episode) -> Choice:
    """When the agent of an episode began to close: the first of the positive actions that make the hand close.

    The hand closes where `closing_start` finds it. If the action there is not positive, that state is the beginning.
    """
    start = closing_start(task.closure(episode.states))
    if start is None:
        return Choice(np.nan, episode.success)
    opening = np.flatnonzero(episode.actions[: start + 1, 0] <= 0.0)
    first = int(opening[-1]) + 1 if opening.size else 0
    return Choice(min(first, start) * CONTROL_STEP, episode.success)


def _window(outcomes: np.ndarray) -> Window:
    """The window of an opening's outcomes (T,)."""
    tried = np.flatnonzero(outcomes != NO_DECISION)
    return Window(tried * CONTROL_STEP, outcomes[tried] == SUCCEEDS)
