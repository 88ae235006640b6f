"""What agents lived through, each in a ring of its own, every state stored once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from baselines.policy import STATE


class Transitions(NamedTuple):
    """What happened, of each of S agents: states and nexts (S, ..., 48), the rest (S, ...)."""

    states: np.ndarray
    actions: np.ndarray
    rewards: np.ndarray
    nexts: np.ndarray
    terminated: np.ndarray


class Replay:
    """The last transitions of S agents; float32, since the networks compute in it.

    A transition is a row whose successor is the next row of the ring, so a state that ends one transition and
    begins another is there once. An episode's last state fills a row that begins none.
    """

    def __init__(self, agents: int, capacity: int) -> None:
        """Room for `capacity` states of each agent; memory is taken as it is filled."""
        self._agents = np.arange(agents)
        self._states = np.zeros((agents, capacity, STATE), np.float32)
        self._actions, self._rewards = np.zeros((2, agents, capacity), np.float32)
        self._terminated = np.zeros((agents, capacity), bool)
        self._begins = np.zeros((agents, capacity), np.int32)  # Rows that begin a transition, oldest first: a ring.
        self._head = np.zeros(agents, int)
        self._first = np.zeros(agents, int)
        self.sizes = np.zeros(agents, int)

    def add(self, lived: Transitions, ended: np.ndarray) -> None:
        """Takes in one transition of each agent, and whether its episode ended there, (S,)."""
        capacity = self._states.shape[1]
        agents, head = self._agents, self._head
        after = (head + 1) % capacity
        self._forget(head, after)
        self._states[agents, head], self._states[agents, after] = lived.states, lived.nexts
        self._actions[agents, head], self._rewards[agents, head] = lived.actions, lived.rewards
        self._terminated[agents, head] = lived.terminated
        self._begins[agents, (self._first + self.sizes) % capacity] = head
        self.sizes += 1
        self._head = np.where(ended, after + 1, after) % capacity

    def pick(self, uniform: np.ndarray) -> Transitions:
        """The transitions that numbers (S, B) in [0, 1) point at."""
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
        """Drops the oldest transitions where they begin at rows (S,) about to be overwritten."""
        for row in rows:
            capacity = self._states.shape[1]
            gone = (self.sizes > 0) & (self._begins[self._agents, self._first % capacity] == row)
            self._first = (self._first + gone) % capacity
            self.sizes = self.sizes - gone
