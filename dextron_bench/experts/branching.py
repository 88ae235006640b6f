"""Plays many experts on one setting in little more time than one expert takes.

Experts of equal gain act equally until the first of them closes. So they share one episode, in which the hand opens.
The shared episode is forked each time the hand comes within the critical distance of another expert. If the bottle
falls in the shared episode, all experts that have not closed fail at once. The outcomes are bit-equal to the outcomes
of the same experts played one by one.
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
    """Experts to play along one path: their common gain K, and their critical distances d_c (m,)."""

    path: Path
    gain: float
    criticals: np.ndarray


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Sum of rewards and number of control steps of each expert of a batch, each (m,)."""

    returns: np.ndarray
    lengths: np.ndarray


def play(engine: Engine, batches: Iterable[ExpertBatch]) -> Iterator[tuple[int, Outcomes]]:
    """Plays all batches and yields each batch's number and outcomes when they are complete, not in order.

    Raises ValueError if a batch has more experts than the engine has slots.
    """
    return _BranchingRollout(engine).run(enumerate(batches))


class _BranchingRollout:
    """The current episodes: one shared episode per batch, and one episode per expert that has closed.

    Experts are ranked by critical distance, the largest first. `_expert` is the rank of a slot's expert; in a
    shared episode, it is the rank of the next expert to close. Free slots are reserved for all forks to come.
    """

    def __init__(self, engine: Engine) -> None:
        n = engine.slots
        self._engine = engine
        self._free = list(range(n))[::-1]
        self._reserved = 0
        self._live = np.zeros(0, int)
        self._number = np.zeros(n, int)
        self._expert = np.zeros(n, int)
        self._is_shared = np.zeros(n, bool)
        self._gain, self._critical, self._first, self._return = np.zeros((4, n))
        self._length = np.zeros(n, int)
        state = (self._number, self._expert, self._gain, self._critical, self._first, self._return, self._length)
        self._per_slot = state  # What a fork copies.
        self._batches: dict[int, ExpertBatch] = {}
        self._ranks: dict[int, np.ndarray] = {}
        self._outcomes: dict[int, Outcomes] = {}
        self._unfinished: dict[int, int] = {}

    def run(self, batches: Iterator[tuple[int, ExpertBatch]]) -> Iterator[tuple[int, Outcomes]]:
        """Yields (number of the batch, outcomes) until no batch is left."""
        pending = next(batches, None)
        while True:
            while pending is not None and len(self._free) - self._reserved >= len(pending[1].criticals):
                self._begin(*pending)
                pending = next(batches, None)
            if pending is not None and not len(self._live):
                raise ValueError(f"{len(pending[1].criticals)} experts need as many slots; there are {len(self._free)}")
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
        self._unfinished[number] = count
        self._number[slot], self._is_shared[slot], self._expert[slot] = number, True, 0
        self._gain[slot], self._critical[slot] = batch.gain, batch.criticals.max()
        self._first[slot] = task.distance(state)[0]
        self._return[slot] = self._length[slot] = 0

    def _step(self) -> list[tuple[int, Outcomes]]:
        states = self._engine.states(self._live)
        started = self._length[self._live] > 0
        within = self._is_closing(self._live, task.distance(states))
        for slot in self._live[within & started & self._is_shared[self._live]]:
            self._fork(slot)
        live = self._live
        states = self._engine.states(live)
        closing = self._is_closing(live, task.distance(states)) & ~self._is_shared[live]
        actions = policies.closing_speeds(task.closure(states), closing, self._gain[live])
        actions[self._length[live] == 0] = 0.0
        step = self._engine.step(live, actions)
        self._return[live] += step.rewards
        self._length[live] += 1
        self._live = live[~step.ended]
        return [finished for slot in live[step.ended] for finished in self._finish(slot)]

    def _is_closing(self, slots: np.ndarray, distances: np.ndarray) -> np.ndarray:
        return policies.is_closing(distances, self._first[slots], self._critical[slots])

    def _fork(self, slot: int) -> None:
        """Forks a shared episode for each expert that closes now; the last expert keeps the slot."""
        number = self._number[slot]
        batch, ranks = self._batches[number], self._ranks[number]
        distance = task.distance(self._engine.states(np.array([slot])))
        while self._is_closing(np.array([slot]), distance)[0]:
            if self._expert[slot] == len(ranks) - 1:
                self._is_shared[slot] = False
                return
            branch = self._free.pop()
            self._reserved -= 1
            self._engine.fork(np.array([slot]), np.array([branch]))
            for per_slot in self._per_slot:
                per_slot[branch] = per_slot[slot]
            self._is_shared[branch] = False
            self._live = np.append(self._live, branch)
            self._expert[slot] += 1
            self._critical[slot] = batch.criticals[ranks[self._expert[slot]]]

    def _finish(self, slot: int) -> list[tuple[int, Outcomes]]:
        """Stores the end of an episode: of one expert, or of all experts of a shared episode that have not closed."""
        number, rank = self._number[slot], self._expert[slot]
        ranks, outcomes = self._ranks[number], self._outcomes[number]
        ended = ranks[rank:] if self._is_shared[slot] else ranks[rank : rank + 1]
        outcomes.returns[ended], outcomes.lengths[ended] = self._return[slot], self._length[slot]
        self._reserved -= len(ended) - 1
        self._free.append(slot)
        self._unfinished[number] -= len(ended)
        if self._unfinished[number]:
            return []
        for per_batch in (self._batches, self._ranks, self._outcomes, self._unfinished):
            del per_batch[number]
        return [(int(number), outcomes)]
