"""The cause of an episode's outcome, and when the hand closed, computed from the states alone.

The hand *closed* if its closure rose by at least CLOSED; the largest rise counts. It closed at the last state before
the top of that rise whose closure is within STILL of the lowest closure.

The setting's expert closes at the first state after the start that satisfies Eq. 1 (d / d_first < d_c or d < 0.03 m);
this needs no replay. The distances are taken from the episode, so the expert's time is exact until the bottle is
touched. If the hand pushes the bottle ahead, the expert's time comes later; if it never comes, the end of the episode
replaces it.

The cause is the first row that applies:

| cause | the episode |
| --- | --- |
| `agent failed` | an action was not allowed |
| `solved` | scores 20 |
| `slipped` | the bottle was raised (to RAISED or higher) and came down again by DROP or more |
| `never reached` | the bottle moved by less than TOUCH, and the palm centre stayed REACHED or more from its axis |
| `too early` | the hand closed before the expert would have closed |
| `too late` | the hand closed later than experts do (IN_TIME) |
| `too late` | the bottle is up at the end: the hand raised it after the countdown had begun |
| `knocked over` | the hand closed in time, and the bottle fell |
| `slipped` | the hand closed in time, and the bottle still stands |
| `knocked over` | the hand never closed; the bottle fell before the expert's time, or a hand closed to FIST hit it |
| `too late` | the hand never closed, and no row above applies |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.experts.policies import Case, is_closing
from dextron_bench.world import model, task

CAUSES = ("solved", "too early", "too late", "knocked over", "slipped", "never reached", "agent failed")

# Measured on episodes of experts, of experts with other d_c, and of agents that ignore states (docs/diagnosis.md).
CLOSED = 0.08  # Rise of closure; the smallest rise of an early grasp that failed was 0.086.
STILL = 0.02
IN_TIME = 6 * model.CONTROL_STEP  # [s] the largest lag of an expert's own episodes.
RAISED = 0.15  # [m] height of the bottle's centre; without a grip it never rose above 0.130.
DROP = 0.02  # [m]
TOUCH = 0.002  # [m]
REACHED = 0.06  # [m] successful experts come within 0.055.
FIST = 0.4  # Closure; 99 % of successful experts touch the bottle with a smaller closure.


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The cause, one of CAUSES, and how much later than the expert the hand closed [s], NaN if it never closed.

    The lag is accurate to IN_TIME: experts themselves have lags of 0 to 0.12 s, mostly 0.04 s.
    """

    cause: str
    closing_lag: float


def diagnose(episode: Episode, case: Case) -> Diagnosis:
    """The diagnosis of an episode; `case` is the case on which it was played."""
    states = episode.states
    start = closing_start(task.closure(states))
    expert_start = expert_closing_start(task.distance(states), case.expert.critical)
    end = len(states) - 1
    lag = np.nan if start is None else (start - (end if expert_start is None else expert_start)) * model.CONTROL_STEP
    return Diagnosis(_cause(episode, lag, fell_first=episode.terminated and expert_start is None), lag)


def closing_start(closures: np.ndarray) -> int | None:
    """The state in which the largest rise of closures (T + 1,) starts, None if no rise reaches CLOSED."""
    lowest = np.minimum.accumulate(closures)
    top = int(np.argmax(closures - lowest))
    if closures[top] - lowest[top] < CLOSED:
        return None
    return int(np.flatnonzero(closures[: top + 1] <= lowest[top] + STILL)[-1])


def expert_closing_start(distances: np.ndarray, critical: float) -> int | None:
    """State in which an expert of a given d_c starts to close, for distances (T + 1,) [m]; None if it never does."""
    closing = is_closing(distances[1:], distances[0], np.array(critical))
    return int(np.argmax(closing)) + 1 if closing.any() else None


def first_touch(states: np.ndarray) -> int | None:
    """The first of states (T + 1, 48) in which the bottle has moved sideways by TOUCH, None if there is none."""
    bottle = states[:, model.BOTTLE_POSITION][:, :2]
    moved = np.linalg.norm(bottle - bottle[0], axis=1) > TOUCH
    return int(np.argmax(moved)) if moved.any() else None


def cause_table(episodes: pd.DataFrame) -> pd.DataFrame:
    """Number of episodes of each method (rows) by cause (columns, in the order of CAUSES)."""
    counts = pd.crosstab(episodes["method"], episodes["cause"])
    return counts.reindex(columns=list(CAUSES), fill_value=0)


def _cause(episode: Episode, lag: float, fell_first: bool) -> str:
    """The cause; `fell_first` is true if the bottle fell before the expert would have closed."""
    if episode.failure:
        return "agent failed"
    if episode.success:
        return "solved"
    states = episode.states
    heights, touched = task.bottle_height(states), first_touch(states)
    if heights.max() >= RAISED and heights.max() - heights[-1] >= DROP:
        return "slipped"
    if touched is None and task.distance(states).min() >= REACHED:
        return "never reached"
    if lag < 0.0:
        return "too early"
    if lag > IN_TIME or heights[-1] >= RAISED:
        return "too late"
    if not np.isnan(lag):
        return "knocked over" if episode.terminated else "slipped"
    fist = touched is not None and task.closure(states)[touched] >= FIST
    return "knocked over" if fell_first or (episode.terminated and fist) else "too late"
