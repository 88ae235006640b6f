"""The ring of experience: states stored once, successors right, the oldest forgotten."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from baselines.replay import Replay, Transitions


def lived(*names: float, terminated: bool = False) -> Transitions:
    """One transition an agent, whose states are full of its name, and whose next states are one more."""
    number = np.array(names)
    states = np.repeat(number[:, None], 48, axis=1)
    return Transitions(states, number * 10.0, number * 100.0, states + 1.0, np.full(len(names), terminated))


def everything(replay: Replay, agent: int = 0) -> set[tuple[float, ...]]:
    size = replay.sizes[agent]
    found = replay.select(np.tile((np.arange(size) + 0.5) / size, (len(replay.sizes), 1)))
    columns = (found.states[agent, :, 0], found.actions[agent], found.rewards[agent], found.nexts[agent, :, 47])
    return set(zip(*(column.tolist() for column in columns), strict=True))


def test_transitions_come_back_with_their_successors_across_the_ends_of_episodes():
    replay = Replay(2, 50)
    for name, ended in ((1, False), (2, True), (7, False), (8, False)):
        replay.add(lived(name, name + 20, terminated=name == 2), np.array([ended, False]))
    assert everything(replay) == {(1, 10, 100, 2), (2, 20, 200, 3), (7, 70, 700, 8), (8, 80, 800, 9)}
    last = replay.select(np.array([[0.26], [0.99]]))
    assert last.terminated.tolist() == [[True], [False]]
    assert last.states[1, 0, 5] == 28.0


def test_numbers_in_the_unit_interval_point_at_transitions_evenly():
    replay = Replay(1, 50)
    for name in range(4):
        replay.add(lived(name), np.array([False]))
    picked = replay.select(np.array([[0.0, 0.24, 0.25, 0.74, 0.75, 0.999]]))
    assert picked.states[0, :, 0].tolist() == [0, 0, 1, 2, 3, 3]


@given(st.lists(st.booleans(), min_size=1, max_size=60), st.integers(4, 12))
def test_a_full_ring_holds_the_latest_transitions_whole(ends, capacity):
    replay, name, latest = Replay(1, capacity), 0.0, []
    for ended in ends:
        replay.add(lived(name), np.array([ended]))
        latest.append((name, 10.0 * name, 100.0 * name, name + 1.0))
        name += 5.0 if ended else 1.0
    kept = sorted(everything(replay))
    assert kept == latest[len(latest) - len(kept) :]
    assert len(kept) >= min(len(ends), (capacity - 1) // 2)
