"""The phase of each state of an episode, computed from its states and actions.

A state has the last phase of this table that applies to it:

| phase | the state |
| --- | --- |
| `reach` | every state |
| `open` | the agent opens the hand: the closure falls by MOVED or more, and the mean action is below 0 |
| `close` | the closure rises by MOVED or more, or has risen so and the agent has not opened the hand since |
| `lift` | the bottle's centre is at RAISED or higher |
| `countdown` | the bottle or the hand has been lifted so far that the countdown runs (`dextron_bench.world.task`) |

A movement of the hand begins at the last state within STILL of the closure that it begins with. If a hand closes once,
`close` therefore begins in the state from which the diagnosis takes the closing lag.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dextron_bench.evaluation.diagnosis import CLOSED as MOVED
from dextron_bench.evaluation.diagnosis import RAISED, STILL
from dextron_bench.world import task

PHASES = ("reach", "open", "close", "lift", "countdown")
REACH, OPEN, CLOSE, LIFT, COUNTDOWN = range(len(PHASES))


def phases(states: np.ndarray, actions: np.ndarray) -> np.ndarray:
    """The phase of each of an episode's states (T + 1, 48) with actions (T, 1): places in PHASES, shape (T + 1,)."""
    places = _movements(task.closure(states), actions[:, 0])
    places[task.bottle_height(states) >= RAISED] = LIFT
    places[countdown_start(states) :] = COUNTDOWN
    return places


def countdown_start(states: np.ndarray) -> int:
    """The state in which the countdown of an episode with states (T, 48) starts; T if it never does."""
    heights = task.hand_height(states)
    started = task.is_lifted(states) | (heights >= heights[0] + task.HAND_RAISED)
    started[0] = False  # It starts after a step.
    return int(np.argmax(started)) if started.any() else len(states)


def turning_points(closures: np.ndarray) -> list[int]:
    """The states between which closures (T,) rise or fall, in turn, by MOVED or more; empty if they never do."""
    points, rises = list[int](), None
    low = high = 0
    for state, closure in enumerate(closures):
        low = state if closure < closures[low] else low
        high = state if closure > closures[high] else high
        if rises is not True and closure - closures[low] >= MOVED:
            points.append(low)
            rises, high = True, state
        elif rises is not False and closures[high] - closure >= MOVED:
            points.append(high)
            rises, low = False, state
    return points if rises is None else [*points, high if rises else low]


def _movements(closures: np.ndarray, actions: np.ndarray) -> np.ndarray:
    """REACH, OPEN or CLOSE for each of the closures (T + 1,) of a hand with actions (T,)."""
    places = np.full(len(closures), REACH)
    for first, last in pairwise(turning_points(closures)):
        movement = closures[first : last + 1]
        start = first + int(np.flatnonzero(np.abs(movement - movement[0]) <= STILL)[-1])
        if movement[-1] > movement[0]:
            places[start:] = CLOSE
        elif actions[start:last].mean() < 0.0:  # Otherwise the bottle pushes the fingers.
            is_open = first + int(np.flatnonzero(movement <= movement[-1] + STILL)[0])
            places[start:is_open] = OPEN
            places[is_open:] = REACH
    return places
