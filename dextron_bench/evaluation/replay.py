"""Episodes again, bit for bit, from their settings and the actions that were taken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.reaches.setting import Setting, Source

NOBODY = Expert(1.0, 0.0)  # Stands in a case that no expert plays.


class Script:
    """An agent that takes given actions, one sequence (T,) an episode, in the order in which episodes begin."""

    def __init__(self, actions: Sequence[np.ndarray]) -> None:
        self._actions, self._begun = actions, 0
        self._of: dict[int, tuple[np.ndarray, int]] = {}  # Of each slot: its actions, and the next of them.

    def reset(self, episodes: np.ndarray) -> None:
        """Gives the next sequences to these rows."""
        for slot in episodes.tolist():
            self._of[slot] = self._actions[self._begun], 0
            self._begun += 1

    def act(self, states: np.ndarray) -> np.ndarray:
        """The next actions (N, 1); NaN, which fails an episode, where a sequence is over before its episode is."""
        found = np.zeros((len(states), 1))
        for slot, (actions, step) in self._of.items():
            found[slot] = actions[step] if step < len(actions) else np.nan
            self._of[slot] = actions, step + 1
        return found


def replay(
    source: Source, settings: Sequence[Setting], actions: Sequence[np.ndarray], threads: int = 0
) -> Iterator[tuple[int, Episode]]:
    """Plays every setting with its actions (T,); yields (index, episode) as episodes end."""
    cases = [Case(setting, NOBODY, 0.0) for setting in settings]
    return rollout(Script(actions), source, cases, threads=threads)
