"""Many experts on one setting, for little more than the price of one.

Experts of equal gain act alike until the first of them closes: they share the opening. So one episode is
simulated with the hand opening, and is forked each time the hand comes within another expert's critical
distance. Where the opening itself knocks the bottle over, every expert still waiting fails there with no
further work. Outcomes are bit-equal to those of the same experts played one by one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dextron_bench.experts import policies
from dextron_bench.reaches.reach import Path
from dextron_bench.world import task
from dextron_bench.world.engine import Engine


@dataclass(frozen=True, slots=True)
class ExpertBatch:
    """What is asked: how do experts of one gain K and critical distances (m,) fare along a path?"""

    path: Path
    gain: float
    criticals: np.ndarray


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Sum of rewards and number of control steps of each expert of a batch, each (m,)."""

    returns: np.ndarray
    lengths: np.ndarray


def play(engine: Engine, batches: Iterable[ExpertBatch]) -> Iterator[tuple[int, Outcomes]]:
    """Plays the batches, filling the engine's slots, and yields each answer with its number as it is complete.

    Raises ValueError for a batch with more experts than the engine has slots.
    """
    return _BranchingRollout(engine).run(enumerate(batches))


class _BranchingRollout:
    """The episodes under way: one opening per batch and one episode per expert that has closed.

    A slot's `expert` is the rank of its expert by critical distance, the largest first; an opening's is
    that of the next to close. Slots that an opening may yet fork into are kept free for it.
    """

    def __init__(self, engine: Engine) -> None:
        n = engine.slots
        self._engine = engine
        self._free = list(range(n))[::-1]
        self._reserved = 0
        self._live = np.zeros(0, int)
        self._number = np.zeros(n, int)
        self._expert = np.zeros(n, int)
        self._opening = np.zeros(n, bool)
        self._gain, self._critical, self._first, self._return = np.zeros((4, n))
        self._length = np.zeros(n, int)
        self._batches: dict[int, ExpertBatch] = {}
        self._ranks: dict[int, np.ndarray] = {}
        self._outcomes: dict[int, Outcomes] = {}
        self._waiting: dict[int, int] = {}

    def run(self, batches: Iterator[tuple[int, ExpertBatch]]) -> Iterator[tuple[int, Outcomes]]:
        """Yields (number, answer) until no batch is left."""
        waiting = next(batches, None)
        while True:
            while waiting is not None and len(self._free) - self._reserved >= len(waiting[1].criticals):
                self._begin(*waiting)
                waiting = next(batches, None)
            if waiting is not None and not len(self._live):
                raise ValueError(f"{len(waiting[1].criticals)} experts need as many slots; there are {len(self._free)}")
            if not len(self._live):
                return
            yield from self._step()

    def _begin(self, number: int, batch: ExpertBatch) -> None:
        count = len(batch.criticals)
        slot = self._free.pop()
        state = self._engine.begin(np.array([slot]), [batch.path])
        self._live = np.append(self._live, slot)
        self._reserved += count - 1
        self._batches[number] = batch
        self._ranks[number] = np.argsort(-batch.criticals, kind="stable")
        self._outcomes[number] = Outcomes(np.zeros(count), np.zeros(count, int))
        self._waiting[number] = count
        self._number[slot], self._opening[slot], self._expert[slot] = number, True, 0
        self._gain[slot], self._critical[slot] = batch.gain, batch.criticals.max()
        self._first[slot] = task.distance(state)[0]
        self._return[slot] = self._length[slot] = 0

    def _step(self) -> list[tuple[int, Outcomes]]:
        states = self._engine.states(self._live)
        started = self._length[self._live] > 0
        within = self._closing(self._live, task.distance(states))
        for slot in self._live[within & started & self._opening[self._live]]:
            self._fork(slot)
        live = self._live
        states = self._engine.states(live)
        closing = self._closing(live, task.distance(states)) & ~self._opening[live]
        actions = policies.closing_speeds(task.closure(states), closing, self._gain[live])
        actions[self._length[live] == 0] = 0.0
        step = self._engine.step(live, actions)
        self._return[live] += step.rewards
        self._length[live] += 1
        self._live = live[~step.ended]
        return [done for slot in live[step.ended] for done in self._finish(slot)]

    def _closing(self, slots: np.ndarray, distances: np.ndarray) -> np.ndarray:
        return policies.is_closing(distances, self._first[slots], self._critical[slots])

    def _fork(self, slot: int) -> None:
        """Lets every expert of an opening that closes now go its own way."""
        number = self._number[slot]
        batch, ranks = self._batches[number], self._ranks[number]
        distance = task.distance(self._engine.states(np.array([slot])))
        while self._closing(np.array([slot]), distance)[0]:
            if self._expert[slot] == len(ranks) - 1:
                self._opening[slot] = False
                return
            branch = self._free.pop()
            self._reserved -= 1
            self._engine.fork(np.array([slot]), np.array([branch]))
            for entries in (
                self._number,
                self._expert,
                self._gain,
                self._critical,
                self._first,
                self._return,
                self._length,
            ):
                entries[branch] = entries[slot]
            self._opening[branch] = False
            self._live = np.append(self._live, branch)
            self._expert[slot] += 1
            self._critical[slot] = batch.criticals[ranks[self._expert[slot]]]

    def _finish(self, slot: int) -> list[tuple[int, Outcomes]]:
        """Books the end of an episode: of one expert, or of all that an opening kept waiting."""
        number, rank = self._number[slot], self._expert[slot]
        ranks, found = self._ranks[number], self._outcomes[number]
        ended = ranks[rank:] if self._opening[slot] else ranks[rank : rank + 1]
        found.returns[ended], found.lengths[ended] = self._return[slot], self._length[slot]
        self._reserved -= len(ended) - 1
        self._free.append(slot)
        self._waiting[number] -= len(ended)
        if self._waiting[number]:
            return []
        for book in (self._batches, self._ranks, self._outcomes, self._waiting):
            del book[number]
        return [(int(number), found)]
