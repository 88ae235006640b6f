"""Plays any agent on any rows, N episodes at once; the only evaluation loop."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from numbers import Integral

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.perturbation import Perturbation
from dextron_bench.experts.policies import Case
from dextron_bench.methods.agents import Agent, AgentCrashed, AgentError, Privileged, as_agent_error
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.rows import Rows
from dextron_bench.world import model, task
from dextron_bench.world.engine import DIVERGED, Engine, Step

SLOTS = 256  # Episodes at once. Fixed, because the last bits of an agent's actions may depend on the batch size.


def rollout(
    agent: Agent,
    source: Source,
    rows: Rows | Iterable[Case],
    slots: int = SLOTS,
    threads: int = 0,
) -> Iterator[tuple[int, Episode]]:
    """Plays every row once; yields (its index in `rows`, episode) in the order in which episodes end.

    `rows` is a split or a part of one, `split.rows(numbers)`, which is played under the split's track and with its
    bottles; a list of cases has neither. An episode has the states and actions of the simulation, not what the agent
    saw and sent under a track.

    Raises AgentError if the agent raises an exception or returns actions of a wrong shape. An action that is not finite
    or lies outside [-1, 1] by more than `task.LEEWAY` fails its own episode only, and so does a simulation that
    diverges; AgentCrashed fails all current episodes. A smaller excess is clipped. TypeError and ValueError are for
    other arguments.
    """
    rows = rows if isinstance(rows, Rows) else Rows(cases=tuple(rows))
    _check(source, rows, slots)
    engine = Engine(min(slots, max(len(rows), 1)), threads)
    return _Evaluation(agent, source, rows, engine).run()


def _check(source: Source, rows: Rows, slots: int) -> None:
    """Raises TypeError and ValueError for arguments that would end a rollout later, or change it silently."""
    if not hasattr(source, "path"):
        raise TypeError(f"source must be a source of reaches, as open_source(name) returns it; got {source!r}")
    if wrong := [case for case in rows.cases if not isinstance(case, Case)]:
        raise TypeError(f"rows must be a split, or have the type Case; got {wrong[0]!r}")
    if not isinstance(slots, Integral) or slots < 1:
        raise ValueError(f"slots must be an integer of at least 1; got {slots!r}")


class _Evaluation:
    """Plays one case per slot; a slot gets the next case when its episode ends."""

    def __init__(self, agent: Agent, source: Source, rows: Rows, engine: Engine) -> None:
        n = engine.slots
        self._perturbation = Perturbation(rows.track, n)
        self._agent, self._source, self._rows, self._engine = agent, source, rows, engine
        self._next = 0
        self._case = np.full(n, -1)
        self._length = np.zeros(n, int)
        self._states = np.zeros((n, task.STEP_LIMIT + 1, model.STATE))
        self._actions = np.zeros((n, task.STEP_LIMIT, 1))
        self._rewards = np.zeros((n, task.STEP_LIMIT))
        self._now = np.zeros((n, model.STATE))

    def run(self) -> Iterator[tuple[int, Episode]]:
        """Yields (index of the case, episode) of every case."""
        self._refill(np.arange(self._engine.slots))
        while (live := np.flatnonzero(self._case >= 0)).size:
            try:
                asked = self._ask()
            except AgentCrashed as error:
                yield from [self._episode(slot, failure=str(error)) for slot in live.tolist()]
                self._refill(live)
                continue
            actions = task.clipped(asked)
            is_valid = ~np.isnan(actions[live, 0])
            valid, invalid = live[is_valid], live[~is_valid]
            arriving = self._perturbation.delay(actions)[valid]
            step = self._engine.step(valid, arriving)
            self._store(valid, arriving, step)
            ended = np.flatnonzero(step.ended & ~step.diverged)
            yield from [self._episode(valid[i], bool(step.terminated[i]), bool(step.truncated[i])) for i in ended]
            yield from [self._episode(slot, failure=DIVERGED) for slot in valid[step.diverged]]
            yield from [self._episode(slot, failure=describe_fault(asked[slot, 0])) for slot in invalid]
            self._refill(np.union1d(valid[step.ended], invalid))

    def _ask(self) -> np.ndarray:
        with as_agent_error("the agent's act()"):
            actions = np.asarray(self._agent.act(self._perturbation.sense(self._now.copy())))
        if actions.shape != (len(self._now), 1) or actions.dtype.kind != "f":
            raise AgentError(
                f"act() must return floats of shape ({len(self._now)}, 1) for states of shape {self._now.shape}; "
                f"it returned {actions.dtype} of shape {actions.shape}"
            )
        return actions.astype(np.float64)

    def _refill(self, slots: np.ndarray) -> None:
        """Starts the next cases in free slots; slots without a case stay idle."""
        self._case[slots] = -1
        slots = slots[: len(self._rows) - self._next]
        if not slots.size:
            return
        cases = self._rows.cases[self._next : self._next + len(slots)]
        bottles = self._rows.bottles[self._next : self._next + len(slots)]
        self._case[slots] = self._next + np.arange(len(slots))
        self._next += len(slots)
        states = self._engine.begin(slots, [self._source.path(case.setting) for case in cases], bottles)
        self._states[slots, 0] = self._now[slots] = states
        self._length[slots] = 0
        self._perturbation.begin(slots, [case.setting for case in cases])
        if isinstance(self._agent, Privileged):
            self._agent.assign(slots, [case.expert for case in cases])
        with as_agent_error("the agent's reset()"):
            self._agent.reset(slots)

    def _store(self, slots: np.ndarray, actions: np.ndarray, step: Step) -> None:
        """Stores a step of slots (n,) with actions (n, 1); a step that diverged is no part of its episode."""
        sound = ~step.diverged
        slots = slots[sound]
        at = self._length[slots]
        self._actions[slots, at], self._rewards[slots, at] = actions[sound], step.rewards[sound]
        self._states[slots, at + 1] = self._now[slots] = step.states[sound]
        self._length[slots] += 1

    def _episode(
        self, slot: int, terminated: bool = False, truncated: bool = False, failure: str = ""
    ) -> tuple[int, Episode]:
        """The index of a slot's case, and its episode so far."""
        n = self._length[slot]
        return int(self._case[slot]), Episode(
            self._rows.cases[self._case[slot]].setting,
            self._states[slot, : n + 1].copy(),
            self._actions[slot, :n].copy(),
            self._rewards[slot, :n].copy(),
            terminated,
            truncated,
            failure and f"{failure} at step {n}",
        )


def describe_fault(action: float) -> str:
    """Why an action is invalid."""
    return f"action {float(action)!r} is outside [-1, 1]" if np.isfinite(action) else f"action is {action}"
