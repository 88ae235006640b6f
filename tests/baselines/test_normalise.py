"""Running means and variances, compared with NumPy's over the whole stream."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from baselines.normalise import EPSILON, PRIOR, Moments


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=40))
def test_moments_equal_the_moments_of_all_values(values):
    moments = Moments(1, 1)
    for value in values:
        moments.update(np.array([[value]]))
    spread = max(1.0, float(np.abs(values).max()))
    assert abs(moments.mean[0, 0] - np.mean(values)) < 1e-3 * spread
    assert abs(moments.variance[0, 0] - np.var(values)) < 1e-3 * spread**2
    assert moments.count[0, 0] == PRIOR + len(values) or abs(moments.count[0, 0] - PRIOR - len(values)) < 1e-9


def test_every_agent_has_its_own_stream():
    moments = Moments(2, 1)
    for values in ([1.0, 10.0], [3.0, 10.0]):
        moments.update(np.array(values)[:, None])
    np.testing.assert_allclose(moments.mean[:, 0], [2.0, 10.0], rtol=1e-3)
    np.testing.assert_allclose(moments.deviation[:, 0], [1.0, 0.0], atol=0.08)
    assert Moments(1, 1).deviation[0, 0] == np.sqrt(1.0 + EPSILON)
