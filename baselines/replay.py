"""The replay buffer: one ring per agent, in which every state is stored once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from baselines.policy import STATE

CAPACITY = 1_000_000  # Transitions in either buffer (table II).


class Transitions(NamedTuple):
    """Transitions of S agents: states and next states `nexts` (S, ..., 48); the other arrays (S, ...)."""

    states: np.ndarray
    actions: np.ndarray
    rewards: np.ndarray
    nexts: np.ndarray
    terminated: np.ndarray


class Replay:
    """The latest transitions of S agents, in float32, the precision of the networks.

    A transition goes from one row of the ring to the next row, so a state that ends one transition and begins another
    is stored once. The last state of an episode takes a row that begins no transition.
    """

    def __init__(self, agents: int, capacity: int) -> None:
        """Reserves `capacity` states per agent; the system provides the memory as the ring fills."""
        self._agents = np.arange(agents)
        self._states = np.zeros((agents, capacity, STATE), np.float32)
        self._actions, self._rewards = np.zeros((2, agents, capacity), np.float32)
        self._terminated = np.zeros((agents, capacity), bool)
        self._begins = np.zeros((agents, capacity), np.int32)  # Rows that begin a transition; a ring, oldest first.
        self._head = np.zeros(agents, int)
        self._first = np.zeros(agents, int)
        self.sizes = np.zeros(agents, int)

    def add(self, transitions: Transitions, ended: np.ndarray) -> None:
        """Adds one transition per agent; `ended` (S,) says whether the episode ended with it."""
        capacity = self._states.shape[1]
        agents, head = self._agents, self._head
        after = (head + 1) % capacity
        self._forget(head, after)
        self._states[agents, head], self._states[agents, after] = transitions.states, transitions.nexts
        self._actions[agents, head], self._rewards[agents, head] = transitions.actions, transitions.rewards
        self._terminated[agents, head] = transitions.terminated
        self._begins[agents, (self._first + self.sizes) % capacity] = head
        self.sizes += 1
        self._head = np.where(ended, after + 1, after) % capacity

    def select(self, uniform: np.ndarray) -> Transitions:
        """The transitions (S, B) that numbers (S, B) in [0, 1) select, from the oldest to the newest."""
        capacity = self._states.shape[1]
        agents = self._agents[:, None]
        place = (uniform * self.sizes[:, None]).astype(int)
        rows = self._begins[agents, (self._first[:, None] + place) % capacity]
        return Transitions(
            self._states[agents, rows],
            self._actions[agents, rows],
            self._rewards[agents, rows],
            self._states[agents, (rows + 1) % capacity],
            self._terminated[agents, rows],
        )

    def _forget(self, *rows: np.ndarray) -> None:
        """Drops the oldest transition of an agent if it begins at one of `rows`, which will be overwritten."""
        for row in rows:
            capacity = self._states.shape[1]
            dropped = (self.sizes > 0) & (self._begins[self._agents, self._first % capacity] == row)
            self._first = (self._first + dropped) % capacity
            self.sizes = self.sizes - dropped
