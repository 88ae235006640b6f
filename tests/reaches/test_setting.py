"""Settings: their distribution, their tables, and the errors for unknown reaches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import dextron_bench
from dextron_bench.errors import BadInput
from dextron_bench.reaches.reach import scaled_duration
from dextron_bench.reaches.setting import LIMITS, OFFSET, Setting, UnknownReach, from_frame, to_frame
from tests.helpers.short_reaches import SETTINGS, SOURCE

DATA = Path(dextron_bench.__file__).parent / "data"


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


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 10.5, -1e6, "0", None, 1j])
def test_a_noise_that_no_episode_can_show_is_refused(value: object):
    """A duration noise of 1e6 made a path of 40 million poses."""
    with pytest.raises(BadInput, match=r"duration_noise of a setting must be a number in \[-10, 10\]; got"):
        Setting("a", 0.0, 0.0, value)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1.001])
def test_an_offset_that_is_not_finite_or_off_the_table_is_refused(place: int, value: float):
    offsets = [0.0, 0.0]
    offsets[place] = value
    with pytest.raises(BadInput, match=rf"offset_{'xy'[place]} of a setting .*; got {value}"):
        Setting("a", offsets[0], offsets[1], 0.0)


def test_a_table_with_a_number_that_is_missing_is_refused():
    table = to_frame(SETTINGS)
    table.loc[2, "offset_y"] = np.nan
    with pytest.raises(BadInput, match="offset_y"):
        from_frame(table)
    with pytest.raises(BadInput, match="the reach of a setting must be a name; got 7"):
        Setting(7, 0.0, 0.0, 0.0)  # pyright: ignore[reportArgumentType]


def test_every_setting_that_ships_lies_within_a_half_of_the_limits():
    for reaches in ("real", "synthetic", "minjerk"):
        table = pd.read_parquet(str(DATA / f"splits-{reaches}.parquet"))
        assert len(from_frame(table)) == len(table) > 0
        for name, limit in LIMITS.items():
            assert table[name].abs().max() <= limit / 2
