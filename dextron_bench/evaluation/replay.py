"""Replays episodes bit for bit from their settings and actions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.reaches.setting import Setting, Source, checked_setting
from dextron_bench.splits.rows import Rows

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
    rows: Rows | Sequence[Setting],
    actions: Sequence[np.ndarray],
    threads: int = 0,
) -> Iterator[tuple[int, Episode]]:
    """Plays every row with its actions (T,) or (T, 1); yields (index, episode) as they end.

    `rows` is a split or a part of one, whose bottles count and whose track does not, since stored actions are those
    that arrived; or a list of settings.

    Raises BadInput; ValueError for actions of another shape or number; and what `rollout` raises.
    """
    rows = rows if isinstance(rows, Rows) else _rows_of(rows)
    sequences = [_sequence(numbers) for numbers in actions]
    if len(sequences) != len(rows):
        raise ValueError(f"actions must have one sequence for each of {len(rows)} settings; got {len(sequences)}")
    return rollout(Script(sequences), source, Rows(cases=rows.cases, bottles=rows.bottles), threads=threads)


def _rows_of(settings: Sequence[Setting]) -> Rows:
    """Rows of settings in which no expert acts; raises BadInput."""
    return Rows(cases=tuple(Case(checked_setting(setting), UNUSED, 0.0) for setting in settings))


def _sequence(actions: np.ndarray) -> np.ndarray:
    """The actions (T,) or (T, 1) of an episode as floats (T,); raises ValueError."""
    try:
        numbers = np.asarray(actions, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"actions of an episode must be numbers of shape (T,) or (T, 1); got {actions!r}") from None
    if numbers.ndim not in (1, 2) or numbers.shape[1:] not in ((), (1,)):
        raise ValueError(f"actions of an episode must have shape (T,) or (T, 1); got {numbers.shape}")
    return numbers.reshape(-1)
