"""Short made-up reaches for tests, one and a half seconds long before they lift; and episodes on a lone engine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from dextron_bench.reaches.minjerk import ORIENTATION
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.setting import ReachSource, Setting
from dextron_bench.world.engine import Engine

GRASP = (-0.015, 0.005)  # [m] an offset from which the closing fingers get hold of the bottle.
BRUSH = (0.02, 0.06)  # [m] one from which the hand knocks it over.


def smooth(u: np.ndarray) -> np.ndarray:
    """A minimum-jerk course from 0 to 1."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def brief(name: str, start: tuple[float, float]) -> Reach:
    """0.5 s from a start (x, y) [m] before the bottle, then 0.7 s up; all takes 3.5 s in an episode without noise."""
    times = np.arange(121) * 0.01
    positions = np.outer(1.0 - smooth(times / 0.5), [*start, 0.0]) + np.outer(smooth((times - 0.5) / 0.7), [0, 0, 0.25])
    positions[:, 2] += 0.1
    return Reach(name, times, positions, np.tile(ORIENTATION, (len(times), 1)), 0.5, "made-up", 0, 3)


SOURCE = ReachSource("brief", [brief("a", (-0.08, -0.2)), brief("b", (-0.05, -0.3))])
SETTINGS = (
    Setting("a", *GRASP, 0.0),
    Setting("b", *GRASP, 0.5),
    Setting("b", *BRUSH, -0.4),
    Setting("a", -0.02, 0.0, 0.7),
    Setting("a", 0.03, 0.04, 0.2),
)
CLOSING = (56, 76, 50, 59, 20)  # Control step from which the fingers of each setting's episode close.


def actions(k: int) -> np.ndarray:
    """The actions (500, 1) that are played in SETTINGS[k]: mostly opening, then mostly closing."""
    rng = np.random.default_rng(k)
    steps = np.arange(500)
    return (np.where(steps < CLOSING[k], -0.8, 0.8) + rng.uniform(-0.2, 0.2, 500))[:, None]


@dataclass(frozen=True, slots=True)
class Played:
    """An episode: states (T + 1, 48), rewards (T,), and how it ended."""

    states: np.ndarray
    rewards: np.ndarray
    terminated: bool
    truncated: bool


@cache
def played(k: int) -> Played:
    """The episode of SETTINGS[k] under actions(k), on an engine of one slot and one thread."""
    engine, slot = Engine(1, threads=1), np.array([0])
    states, rewards = [engine.begin(slot, [SOURCE.path(SETTINGS[k])])[0]], []
    for action in actions(k):
        step = engine.step(slot, action[None])
        states.append(step.states[0])
        rewards.append(step.rewards[0])
        if step.ended[0]:
            return Played(np.array(states), np.array(rewards), bool(step.terminated[0]), bool(step.truncated[0]))
    raise AssertionError("an episode outlasted its limit")
