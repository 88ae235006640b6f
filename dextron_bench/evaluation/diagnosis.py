"""How an episode ended, beside its return, and when the hand closed. Read off the states alone.

The hand *closed* where its closure rose by at least CLOSED; of several rises the largest counts. The moment is the
last state at which the closure was still within STILL of where that rise began. An expert closes at the first
state after the start in which Eq. 1 says so (d / d_first < d_c or d < 0.03 m): nothing has to be replayed. The
distances are the episode's own, so that this is exact until the bottle is touched; a bottle that is pushed ahead
puts the expert's moment off, and where it does not come at all, the episode's end stands in for it.

Causes, the first that applies:

| cause | the episode |
| --- | --- |
| `agent failed` | an action was not allowed |
| `solved` | scores 20 |
| `slipped` | the bottle was gripped (up to RAISED) and came down again by DROP or more |
| `never reached` | the bottle was not touched (moved by TOUCH), the palm centre stayed REACHED or more from its axis |
| `too early` | the hand closed before the expert's moment |
| `too late` | the hand closed later than experts are themselves found to (IN_TIME) |
| `too late` | the bottle is up at the end, in a grip that raised it after the countdown had begun |
| `knocked over` | the bottle fell, though the hand closed in time |
| `slipped` | the hand closed in time, and the bottle was left standing |
| `knocked over` | the hand never closed; the bottle fell before the expert's moment, or a hand closed to FIST hit it |
| `too late` | the hand never closed, and none of the above |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.experts.policies import Case, is_closing
from dextron_bench.world import model, task

CAUSES = ("solved", "too early", "too late", "knocked over", "slipped", "never reached", "agent failed")

# From episodes of experts, of experts with other d_c, and of blind agents: see docs/diagnosis.md.
CLOSED = 0.08  # Rise of closure; the least in an early grasp that failed was 0.086.
STILL = 0.02
IN_TIME = 6 * model.CONTROL_STEP  # [s] the latest that an expert is itself found to close.
RAISED = 0.15  # [m] height of the bottle's centre; in no grip it never came above 0.130.
DROP = 0.02  # [m]
TOUCH = 0.002  # [m]
REACHED = 0.06  # [m] experts that succeed come within 0.055.
FIST = 0.4  # Closure; 99 % of experts that succeed touch the bottle with less.


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """One of CAUSES, and when the hand closed after the expert would have [s], NaN where it never closed.

    The lag is good to IN_TIME: experts themselves have 0 to 0.12 s, mostly 0.04.
    """

    cause: str
    closing_lag: float


def diagnose(episode: Episode, case: Case) -> Diagnosis:
    """What became of an episode of a case, which must be its own."""
    states = episode.states
    closed = closing_start(task.closure(states))
    expected = expert_closing_start(task.distance(states), case.expert.critical)
    end = len(states) - 1
    lag = np.nan if closed is None else (closed - (end if expected is None else expected)) * model.CONTROL_STEP
    return Diagnosis(_cause(episode, lag, fell_first=episode.terminated and expected is None), lag)


def closing_start(closures: np.ndarray) -> int | None:
    """The state at which the largest rise of closures (T + 1,) began, None where there was none of CLOSED."""
    lowest = np.minimum.accumulate(closures)
    top = int(np.argmax(closures - lowest))
    if closures[top] - lowest[top] < CLOSED:
        return None
    return int(np.flatnonzero(closures[: top + 1] <= lowest[top] + STILL)[-1])


def expert_closing_start(distances: np.ndarray, critical: float) -> int | None:
    """The state in which an expert with that d_c begins to close for distances (T + 1,) [m], None where it does not."""
    closing = is_closing(distances[1:], distances[0], np.array(critical))
    return int(np.argmax(closing)) + 1 if closing.any() else None


def first_touch(states: np.ndarray) -> int | None:
    """The first of states (T + 1, 48) in which the bottle has moved sideways by TOUCH, None where there is none."""
    bottle = states[:, model.BOTTLE_POSITION][:, :2]
    moved = np.linalg.norm(bottle - bottle[0], axis=1) > TOUCH
    return int(np.argmax(moved)) if moved.any() else None


def cause_table(episodes: pd.DataFrame) -> pd.DataFrame:
    """Episodes of each method (rows) by cause (columns, as CAUSES) from a table with columns `method`, `cause`."""
    counts = pd.crosstab(episodes["method"], episodes["cause"])
    return counts.reindex(columns=list(CAUSES), fill_value=0)


def _cause(episode: Episode, lag: float, fell_first: bool) -> str:
    """The cause; `fell_first` where the bottle fell before the expert's moment."""
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
