"""Eq. 1 with numbers computed by hand."""

import numpy as np

from dextron_bench.experts import policies
from dextron_bench.world import model


def state(closure: float, distance: float) -> np.ndarray:
    """A state (48,) with one closure of all proximal joints, and a distance [m] from palm centre to bottle."""
    row = np.zeros(48)
    row[3] = row[10] = 1.0
    joints, closed = model.proximal()
    row[joints] = closure * closed
    row[7:10] = [distance, -0.09, 0.1]
    return row


def test_experts_close_within_the_critical_distance_or_within_three_centimetres():
    distances, first = np.array([0.10, 0.099, 0.0301, 0.0299]), np.array([0.2, 0.2, 0.2, 0.2])
    critical = np.array([0.5, 0.5, 0.1, 0.1])
    assert policies.is_closing(distances, first, critical).tolist() == [False, True, False, True]


def test_closing_speed_is_proportional_to_the_error_and_clipped():
    closures, closing, gain = (
        np.array([0.5, 0.5, 0.9, 0.0]),
        np.array([False, True, False, True]),
        np.array([1.0, 1.2, 1.5, 2.0]),
    )
    # 1 (0 - 0.5), 1.2 (0.8 - 0.5), 1.5 (0 - 0.9) clipped, 2 (0.8 - 0) clipped.
    np.testing.assert_allclose(policies.closing_speeds(closures, closing, gain).ravel(), [-0.5, 0.36, -1.0, 1.0])


def test_the_agent_first_sends_0_and_divides_by_the_first_distance():
    agent = policies.ExpertAgent()
    agent.assign(np.array([0, 1]), [policies.Expert(1.0, 0.5), policies.Expert(1.5, 0.2)])
    agent.reset(np.array([0, 1]))
    far = np.stack([state(0.5, 0.4), state(0.5, 0.4)])
    assert agent.act(far).ravel().tolist() == [0.0, 0.0]
    near = np.stack([state(0.5, 0.19), state(0.5, 0.19)])
    # 0.19 / 0.4 = 0.475: within 0.5 but not within 0.2.
    np.testing.assert_allclose(agent.act(near).ravel(), [0.3, -0.75])


def test_a_reset_forgets_one_episode_only():
    agent = policies.ExpertAgent()
    agent.assign(np.array([0, 1]), [policies.Expert(1.0, 0.5)] * 2)
    agent.reset(np.array([0, 1]))
    agent.act(np.stack([state(0.5, 0.4)] * 2))
    agent.reset(np.array([1]))
    np.testing.assert_allclose(agent.act(np.stack([state(0.5, 0.19)] * 2)).ravel(), [0.3, 0.0])
