"""The protocol of an isolated agent: any line is parsed or refused, and numbers are sent bit for bit."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dextron_bench.methods.isolation import protocol


@given(st.binary(max_size=200), st.integers(1, 5))
def test_any_answer_is_parsed_as_actions_or_raises(line: bytes, count: int):
    with suppress(protocol.BadAnswer):
        assert protocol.read_actions(line, count).shape == (count, 1)


@given(st.lists(st.floats(), min_size=1, max_size=5))
def test_actions_and_states_are_sent_bit_for_bit(actions: list[float]):
    sent = np.array(actions)[:, None]
    np.testing.assert_array_equal(protocol.read_actions(protocol.write_actions(sent), len(actions)), sent)
    states = np.array(actions)[:, None].repeat(48, axis=1)
    rows, received = protocol.read_question(protocol.write_question([0], states))
    assert rows.tolist() == [0]
    np.testing.assert_array_equal(received, states)
