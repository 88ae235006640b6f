"""Plays many experts on one setting in little more time than one expert takes.

Experts of equal gain act equally as long as all of them close, or all of them open. So they share one episode, which
is forked when the hand comes within the critical distance of some of them only. The outcomes are bit-equal to the
outcomes of the same experts played one by one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dextron_bench.experts import policies
from dextron_bench.reaches.reach import Trajectory
from dextron_bench.world import task
from dextron_bench.world.bottle import Bottle
from dextron_bench.world.engine import Engine


@dataclass(frozen=True, slots=True)
class ExpertBatch:
    """Experts to play along one path: their common gain K, and their critical distances d_c (m,).

    Without a `bottle` they meet the model's.
    """

    path: Trajectory
    gain: float
    criticals: np.ndarray
    bottle: Bottle | None = None


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
    """The current episodes. Each is shared by experts of one batch that have acted equally until now.

    Experts are ranked by critical distance, the largest first; a slot plays the ranks from `_low` to `_high`, and
    `_largest` and `_smallest` are their critical distances. Free slots are reserved for all forks to come.
    """

    def __init__(self, engine: Engine) -> None:
        n = engine.slots
        self._engine = engine
        self._free = list(range(n))[::-1]
        self._reserved = 0
        self._live = np.zeros(0, int)
        self._number, self._low, self._high, self._length = np.zeros((4, n), int)
        self._gain, self._first, self._return, self._largest, self._smallest = np.zeros((5, n))
        shared = (self._number, self._low, self._high, self._length, self._gain, self._first, self._return)
        self._per_slot = (*shared, self._largest, self._smallest)  # What a fork copies.
        self._ranks: dict[int, np.ndarray] = {}
        self._criticals: dict[int, np.ndarray] = {}  # By rank.
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
        state = self._engine.begin(np.array([slot]), [batch.path], [batch.bottle] if batch.bottle else ())
        self._live = np.append(self._live, slot)
        self._reserved += count - 1
        ranks = np.argsort(-batch.criticals, kind="stable")
        self._ranks[number], self._criticals[number] = ranks, batch.criticals[ranks]
        self._outcomes[number] = Outcomes(np.zeros(count), np.zeros(count, int))
        self._unfinished[number] = count
        self._number[slot], self._gain[slot], self._first[slot] = number, batch.gain, task.distance(state)[0]
        self._return[slot] = self._length[slot] = 0
        self._set_ranks(slot, 0, count)

    def _set_ranks(self, slot: int, low: int, high: int) -> None:
        """Lets a slot play the experts with ranks from `low` to `high` of its batch."""
        criticals = self._criticals[self._number[slot]]
        self._low[slot], self._high[slot] = low, high
        self._largest[slot], self._smallest[slot] = criticals[low], criticals[high - 1]

    def _step(self) -> list[tuple[int, Outcomes]]:
        live = self._live
        distances = task.distance(self._engine.states(live))
        some = policies.is_closing(distances, self._first[live], self._largest[live])
        every = policies.is_closing(distances, self._first[live], self._smallest[live])
        for k in np.flatnonzero(some & ~every & (self._length[live] > 0)):
            self._fork(int(live[k]), distances[k : k + 1])
        live = self._live
        states = self._engine.states(live)
        closing = policies.is_closing(task.distance(states), self._first[live], self._largest[live])
        actions = policies.closing_speeds(task.closure(states), closing, self._gain[live])
        actions[self._length[live] == 0] = 0.0
        step = self._engine.step(live, actions)
        self._return[live] += step.rewards
        self._length[live] += 1
        self._live = live[~step.ended]
        return [finished for slot in live[step.ended] for finished in self._finish(slot)]

    def _fork(self, slot: int, distance: np.ndarray) -> None:
        """Forks an episode: the experts that close at this distance (1,) [m] go on in a slot of their own."""
        low, high = int(self._low[slot]), int(self._high[slot])
        criticals = self._criticals[self._number[slot]][low:high]
        middle = low + int(policies.is_closing(distance, self._first[[slot]], criticals).sum())
        branch = self._free.pop()
        self._reserved -= 1
        self._engine.fork(np.array([slot]), np.array([branch]))
        for per_slot in self._per_slot:
            per_slot[branch] = per_slot[slot]
        self._live = np.append(self._live, branch)
        self._set_ranks(branch, low, middle)
        self._set_ranks(slot, middle, high)

    def _finish(self, slot: int) -> list[tuple[int, Outcomes]]:
        """Stores the end of an episode for the experts that share it; the batch's outcomes if they were the last."""
        number = int(self._number[slot])
        ended = self._ranks[number][self._low[slot] : self._high[slot]]
        outcomes = self._outcomes[number]
        outcomes.returns[ended], outcomes.lengths[ended] = self._return[slot], self._length[slot]
        self._reserved -= len(ended) - 1
        self._free.append(slot)
        self._unfinished[number] -= len(ended)
        if self._unfinished[number]:
            return []
        for per_batch in (self._ranks, self._criticals, self._outcomes, self._unfinished):
            del per_batch[number]
        return [(number, outcomes)]
