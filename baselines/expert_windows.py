"""Labels of STOPPING without forks: closing works where an expert of the setting would begin to close and succeed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dextron_bench import Case, TrainingSetup, rollout
from dextron_bench.experts.openings import EVERY, FAILS, NEAR, NO_DECISION, SUCCEEDS, OpeningSteps
from dextron_bench.world import task


def play(setup: TrainingSetup, cases: Sequence[Case]) -> list[OpeningSteps]:
    """The openings of the cases' settings, with outcomes from their windows; those without any success are left out."""
    episodes: dict[int, OpeningSteps] = {}
    for number, played in rollout(_Opening(), setup.source, cases, threads=setup.threads):
        states = played.states[:-1]
        episodes[number] = states, outcomes(cases[number], task.distance(states))
        setup.report(len(episodes), len(cases), "settings opened")
    return [one for _, one in sorted(episodes.items()) if (one[1] == SUCCEEDS).any()]


def outcomes(case: Case, distances: np.ndarray) -> np.ndarray:
    """The outcomes (T,) of an opening with distances [m] (T,): SUCCEEDS at decisions within the window of the case.

    An expert closes once the distance, as a share of the first one, is below d_c. So its window of d_c says at which
    distances closing works, until the hand goes away again. An expert closes more slowly than STOPPING.
    """
    labels = np.full(len(distances), NO_DECISION, np.int8)
    near = np.flatnonzero(distances < NEAR)
    if near.size:
        decisions = np.arange(near[0], len(distances), EVERY)
        within = np.abs(distances / distances[0] - case.expert.critical) < case.window / 2.0
        works = within & (distances == np.minimum.accumulate(distances))
        labels[decisions] = np.where(works[decisions], SUCCEEDS, FAILS)
    return labels


class _Opening:
    """An agent that opens the hand at full speed."""

    def reset(self, episodes: np.ndarray) -> None:
        """Nothing depends on earlier steps."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Actions (N, 1) for states (N, 48)."""
        return np.full((len(states), 1), -1.0)
