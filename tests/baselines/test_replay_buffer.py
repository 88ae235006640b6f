"""The replay buffer: next states are correct, and the oldest transitions are overwritten."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from baselines.replay import Replay, Transitions


def transition(*names: float, terminated: bool = False) -> Transitions:
    """One transition per agent: all numbers of its state are `names`, and of its next state one more."""
    number = np.array(names)
    states = np.repeat(number[:, None], 48, axis=1)
    return Transitions(states, number * 10.0, number * 100.0, states + 1.0, np.full(len(names), terminated))


def all_transitions(replay: Replay, agent: int = 0) -> set[tuple[float, ...]]:
    size = replay.sizes[agent]
    selected = replay.select(np.tile((np.arange(size) + 0.5) / size, (len(replay.sizes), 1)))
    columns = (
        selected.states[agent, :, 0],
        selected.actions[agent],
        selected.rewards[agent],
        selected.nexts[agent, :, 47],
    )
    return set(zip(*(column.tolist() for column in columns), strict=True))


def test_transitions_keep_their_next_states_at_the_ends_of_episodes():
    replay = Replay(2, 50)
    for number, ended in ((1, False), (2, True), (7, False), (8, False)):
        replay.add(transition(number, number + 20, terminated=number == 2), np.array([ended, False]))
    assert all_transitions(replay) == {(1, 10, 100, 2), (2, 20, 200, 3), (7, 70, 700, 8), (8, 80, 800, 9)}
    last = replay.select(np.array([[0.26], [0.99]]))
    assert last.terminated.tolist() == [[True], [False]]
    assert last.states[1, 0, 5] == 28.0


def test_numbers_in_the_unit_interval_select_transitions_evenly():
    replay = Replay(1, 50)
    for number in range(4):
        replay.add(transition(number), np.array([False]))
    selected = replay.select(np.array([[0.0, 0.24, 0.25, 0.74, 0.75, 0.999]]))
    assert selected.states[0, :, 0].tolist() == [0, 0, 1, 2, 3, 3]


@given(st.lists(st.booleans(), min_size=1, max_size=60), st.integers(4, 12))
def test_a_full_ring_holds_the_latest_transitions(ends, capacity):
    replay, number, latest = Replay(1, capacity), 0.0, []
    for ended in ends:
        replay.add(transition(number), np.array([ended]))
        latest.append((number, 10.0 * number, 100.0 * number, number + 1.0))
        number += 5.0 if ended else 1.0
    kept = sorted(all_transitions(replay))
    assert kept == latest[len(latest) - len(kept) :]
    assert len(kept) >= min(len(ends), (capacity - 1) // 2)
