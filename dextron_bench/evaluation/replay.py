"""Replays episodes bit for bit from their settings and actions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.world.bottle import Bottle

UNUSED = Expert(1.0, 0.0)  # The expert of a case in which no expert acts.


class Script:
    """An agent that sends given actions: one sequence (T,) per episode, in the order in which episodes begin."""

    def __init__(self, actions: Sequence[np.ndarray]) -> None:
        self._sequences, self._begun = actions, 0
        self._playing: dict[int, tuple[np.ndarray, int]] = {}  # The actions of each slot, and the next step.

    def reset(self, episodes: np.ndarray) -> None:
        """Assigns the next sequences to these rows."""
        for slot in episodes.tolist():
            self._playing[slot] = self._sequences[self._begun], 0
            self._begun += 1

    def act(self, states: np.ndarray) -> np.ndarray:
        """The next actions (N, 1); NaN, which fails the episode, if a sequence is shorter than its episode."""
        next_actions = np.zeros((len(states), 1))
        for slot, (actions, step) in self._playing.items():
            next_actions[slot] = actions[step] if step < len(actions) else np.nan
            self._playing[slot] = actions, step + 1
        return next_actions


def replay(
    source: Source,
    settings: Sequence[Setting],
    actions: Sequence[np.ndarray],
    threads: int = 0,
    bottles: Sequence[Bottle] = (),
) -> Iterator[tuple[int, Episode]]:
    """Plays every setting, perhaps with a bottle, with its actions (T,); yields (index, episode) as episodes end."""
    cases = [Case(setting, UNUSED, 0.0) for setting in settings]
    return rollout(Script(actions), source, cases, threads=threads, bottles=bottles)
