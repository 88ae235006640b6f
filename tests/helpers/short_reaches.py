"""Short made-up reaches for tests, and reference episodes on an engine with one slot."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from dextron_bench.reaches.minjerk import ORIENTATION
from dextron_bench.reaches.reach import Reach, Trajectory
from dextron_bench.reaches.setting import ReachSource, Setting
from dextron_bench.world.engine import Engine

GRASP = (-0.015, 0.005)  # [m] an offset at which the closing fingers grasp the bottle.
BRUSH = (0.02, 0.06)  # [m] an offset at which the hand knocks the bottle over.


def minimum_jerk(u: np.ndarray) -> np.ndarray:
    """A minimum-jerk profile from 0 to 1."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def short_reach(name: str, start: tuple[float, float]) -> Reach:
    """0.5 s from a start (x, y) [m] to the bottle, then 0.7 s up. An episode without noise takes 3.5 s."""
    times = np.arange(121) * 0.01
    approach = np.outer(1.0 - minimum_jerk(times / 0.5), [*start, 0.0])
    positions = approach + np.outer(minimum_jerk((times - 0.5) / 0.7), [0, 0, 0.25])
    positions[:, 2] += 0.1
    return Reach(name, times, positions, np.tile(ORIENTATION, (len(times), 1)), 0.5, "made-up", 0, 3)


SOURCE = ReachSource("brief", [short_reach("a", (-0.08, -0.2)), short_reach("b", (-0.05, -0.3))])
SETTINGS = (
    Setting("a", *GRASP, 0.0),
    Setting("b", *GRASP, 0.5),
    Setting("b", *BRUSH, -0.4),
    Setting("a", -0.02, 0.0, 0.7),
    Setting("a", 0.03, 0.04, 0.2),
)
TORN, TORN_POSE = Setting("a", *GRASP, 0.3), 30  # A setting whose path has no number at that pose.
CLOSING = (56, 76, 50, 88, 20)  # Control step from which the fingers close, for each setting.


class TornSource(ReachSource):
    """SOURCE, but the simulation of TORN diverges in the step to TORN_POSE."""

    def __init__(self) -> None:
        super().__init__("torn", [SOURCE.reach(name) for name in SOURCE.names])

    def path(self, setting: Setting) -> Trajectory:
        """The path of SOURCE, which is broken for TORN."""
        path = super().path(setting)
        if setting == TORN:
            path.positions[TORN_POSE, 0] = np.nan
        return path


def actions(k: int) -> np.ndarray:
    """Actions (500, 1) for SETTINGS[k]: first opening, then closing, with noise."""
    rng = np.random.default_rng(k)
    steps = np.arange(500)
    return (np.where(steps < CLOSING[k], -0.8, 0.8) + rng.uniform(-0.2, 0.2, 500))[:, None]


@dataclass(frozen=True, slots=True)
class PlayedEpisode:
    """An episode: states (T + 1, 48), rewards (T,), and how it ended."""

    states: np.ndarray
    rewards: np.ndarray
    terminated: bool
    truncated: bool


@cache
def played(k: int) -> PlayedEpisode:
    """The episode of SETTINGS[k] with actions(k), on an engine with one slot and one thread."""
    engine, slot = Engine(1, threads=1), np.array([0])
    states, rewards = [engine.begin(slot, [SOURCE.path(SETTINGS[k])])[0]], []
    for action in actions(k):
        step = engine.step(slot, action[None])
        states.append(step.states[0])
        rewards.append(step.rewards[0])
        if step.ended[0]:
            return PlayedEpisode(np.array(states), np.array(rewards), bool(step.terminated[0]), bool(step.truncated[0]))
    raise AssertionError("an episode exceeded its limit")
