"""When closing works: episodes with an opening hand, forked at every decision, with a hand that closes from there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dextron_bench.reaches.reach import Trajectory
from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.world import task
from dextron_bench.world.bottle import Bottle
from dextron_bench.world.engine import Engine

NEAR = 0.16  # [m] distance from which on closing is tried.
EVERY = 2  # Control steps between decisions.
FIRST_TRIED = 3  # Every third decision is tried; then the decisions between a success and a failure.
TOGETHER = 96  # Settings that are played together.
SLOTS = 1024
NO_DECISION, FAILS, SUCCEEDS = -1, 0, 1
OpeningSteps = tuple[np.ndarray, np.ndarray]  # States (T, 48) and outcomes (T,) of an opening.
Begin = Callable[[np.ndarray, np.ndarray], np.ndarray]  # Starts numbered openings in slots; returns their states.


@dataclass(frozen=True, slots=True)
class Openings:
    """Episodes with an opening hand, one after the other: states (R, 48), float32, and `outcomes` (R,), int8.

    Episode k has the rows from `starts[k]` to `starts[k + 1]`. An outcome says whether a hand that closes at full speed
    from that state on earns all rewards: SUCCEEDS, FAILS, or NO_DECISION. If two decisions that were tried have one
    outcome, the decisions between them are taken to have it too.
    """

    states: np.ndarray
    outcomes: np.ndarray
    starts: np.ndarray

    def __len__(self) -> int:
        return len(self.starts) - 1

    def rows(self, episode: int) -> slice:
        """The rows of an episode."""
        return slice(self.starts[episode], self.starts[episode + 1])

    def episodes(self) -> list[OpeningSteps]:
        """States and outcomes of each episode."""
        return [(self.states[rows], self.outcomes[rows]) for rows in map(self.rows, range(len(self)))]


def play(
    source: Source, settings: Sequence[Setting], threads: int = 0, bottles: Sequence[Bottle] = ()
) -> list[OpeningSteps]:
    """The openings of some settings; `bottles` has one for each, or none if all have the model's."""
    engine = Engine(SLOTS, threads)
    return [
        episode
        for first in range(0, len(settings), TOGETHER)
        for episode in _play_together(
            engine,
            [source.path(setting) for setting in settings[first : first + TOGETHER]],
            bottles[first : first + TOGETHER],
        )
    ]


def joined(episodes: Sequence[OpeningSteps]) -> Openings:
    """Openings, one after the other."""
    states, outcomes = zip(*episodes, strict=True)
    starts = np.concatenate([[0], np.cumsum([len(part) for part in states])])
    return Openings(np.concatenate(states).astype(np.float32), np.concatenate(outcomes), starts)


def _play_together(engine: Engine, paths: Sequence[Trajectory], bottles: Sequence[Bottle]) -> Iterator[OpeningSteps]:
    """The opening of each path."""

    def begin(slots: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        return engine.begin(slots, [paths[k] for k in numbers], [bottles[k] for k in numbers if bottles])

    live = np.arange(len(paths))
    states = begin(live, live)
    episodes: list[list[np.ndarray]] = [[] for _ in paths]
    first_near = np.full(len(paths), -1)
    decisions, saved = [], []
    for step in range(task.STEP_LIMIT + 1):
        for k, state in zip(live, states, strict=True):
            episodes[k].append(state)
        is_near = task.distance(states) < NEAR
        first_near[live[is_near & (first_near[live] < 0)]] = step
        decides = live[(first_near[live] >= 0) & ((step - first_near[live]) % EVERY == 0)]
        decisions.append(np.stack([decides, np.full_like(decides, step)], axis=1))
        saved.append(engine.save(decides))
        result = engine.step(live, np.full((len(live), 1), -1.0))
        live, states = live[~result.ended], result.states[~result.ended]
        if not live.size:
            break
    episode, step = np.concatenate(decisions).T
    order = np.lexsort((step, episode))
    starts = {name: np.concatenate([part[name] for part in saved])[order] for name in saved[0]}
    tried = _try(engine, begin, episode[order], starts)
    outcomes = [np.full(len(states), NO_DECISION, np.int8) for states in episodes]
    for k, t, outcome in zip(episode[order], step[order], tried, strict=True):
        outcomes[k][t] = outcome
    return zip(map(np.array, episodes), outcomes, strict=True)


def _try(engine: Engine, begin: Begin, episode: np.ndarray, starts: dict[str, np.ndarray]) -> np.ndarray:
    """Outcomes (n,) of closing from saved states (n, ...) of episodes (n,), which lie in order."""
    position = np.arange(len(episode)) - np.searchsorted(episode, episode)
    outcomes = np.full(len(episode), NO_DECISION, np.int8)

    def play(rows: np.ndarray) -> None:
        scores = _close(engine, begin, episode[rows], {name: part[rows] for name, part in starts.items()})
        outcomes[rows] = np.where(scores == task.SUCCESS, SUCCEEDS, FAILS)

    play(np.flatnonzero(position % FIRST_TRIED == 0))
    before = outcomes[np.arange(len(episode)) - position % FIRST_TRIED]
    after_row = np.arange(len(episode)) - position % FIRST_TRIED + FIRST_TRIED
    last = np.searchsorted(episode, episode, side="right")
    after = np.where(after_row < last, outcomes[np.minimum(after_row, len(episode) - 1)], FAILS)
    play(np.flatnonzero((outcomes == NO_DECISION) & (before != after)))
    return np.where(outcomes == NO_DECISION, before, outcomes)


def _close(engine: Engine, begin: Begin, episode: np.ndarray, starts: dict[str, np.ndarray]) -> np.ndarray:
    """Sums of rewards (n,) of numbered openings (n,) that go on from saved states (n, ...) and close at full speed."""
    scores, playing = np.zeros(len(episode)), np.full(engine.slots, -1)
    waiting = iter(range(len(episode)))
    while True:
        free = np.flatnonzero(playing < 0)
        new = np.array([number for _, number in zip(free, waiting, strict=False)], int)
        slots = free[: len(new)]
        if len(new):
            playing[slots] = new
            begin(slots, episode[new])
            engine.load(slots, {name: rows[new] for name, rows in starts.items()})
        live = np.flatnonzero(playing >= 0)
        if not live.size:
            return scores
        result = engine.step(live, np.ones((len(live), 1)))
        scores[playing[live]] += result.rewards
        playing[live[result.ended]] = -1
