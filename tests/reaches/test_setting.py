"""Settings: their distribution, their tables, and the errors for unknown reaches."""

from __future__ import annotations

import numpy as np
import pytest

from dextron_bench.reaches.reach import scaled_duration
from dextron_bench.reaches.setting import OFFSET, Setting, UnknownReach, from_frame, to_frame
from tests.helpers.short_reaches import SETTINGS, SOURCE


def test_settings_have_uniform_offsets_and_no_noise_that_makes_a_reach_faster():
    rng = np.random.default_rng(0)
    settings = [SOURCE.sample(rng) for _ in range(2000)]
    offsets = np.array([(s.offset_x, s.offset_y) for s in settings])
    assert np.abs(offsets).max() <= OFFSET
    np.testing.assert_allclose(offsets.mean(axis=0), 0.0, atol=0.003)
    np.testing.assert_allclose(offsets.var(axis=0), OFFSET**2 / 3, rtol=0.1)
    assert {s.reach for s in settings} == {"a", "b"}
    recorded = SOURCE.reach("a").duration
    assert min(scaled_duration(recorded, s.duration_noise) for s in settings) >= recorded


def test_a_table_of_settings_gives_the_same_settings():
    table = to_frame(SETTINGS)
    assert list(table.columns) == ["reach", "offset_x", "offset_y", "duration_noise"]
    assert from_frame(table.assign(gain=2.0)) == list(SETTINGS)


def test_the_error_for_an_unknown_reach_gives_examples_of_names():
    with pytest.raises(UnknownReach, match="no reach 'c' in source 'brief'; it has names like a, b"):
        SOURCE.path(Setting("c", 0.0, 0.0, 0.0))
    with pytest.raises(UnknownReach):
        SOURCE.stratum("c")
