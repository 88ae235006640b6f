"""New reaches follow from the settings that a model is fitted to, and from nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from baselines import generated_reaches
from dextron_bench.reaches.reach import palm_centre
from dextron_bench.reaches.setting import OFFSET, ReachSource, Setting
from dextron_bench.reaches.sources import open_source
from dextron_bench.reaches.synthetic.fitted import TooFewRegions
from dextron_bench.reaches.synthetic.generator import open_synthetic
from tests.helpers.short_reaches import SETTINGS, SOURCE

SYNTHETIC = open_synthetic()
SOME, OTHERS = SYNTHETIC.names[:144], SYNTHETIC.names[144:288]  # Nine subjects, 16 start regions.
KNOWN = [Setting(name, 0.02, 0.01, 0.5) for name in SOME]


@pytest.fixture(scope="module")
def generated() -> tuple[ReachSource, list[Setting]]:
    return generated_reaches.generate(SYNTHETIC, KNOWN, 6)


@pytest.mark.slow
def test_equal_settings_give_equal_reaches_and_other_reaches_give_other_names(
    generated: tuple[ReachSource, list[Setting]],
):
    source, settings = generated
    again, same = generated_reaches.generate(SYNTHETIC, KNOWN, 6)
    assert (again.names, same) == (source.names, settings)
    for name in again.names:
        np.testing.assert_array_equal(again.reach(name).positions, source.reach(name).positions)
    others, _ = generated_reaches.generate(SYNTHETIC, [Setting(name, 0.02, 0.01, 0.5) for name in OTHERS], 6)
    assert not set(others.names) & set(source.names)


def test_generated_reaches_are_new_and_arrive_where_the_others_do(generated: tuple[ReachSource, list[Setting]]):
    """Each begins in the region of its number."""
    reaches = [generated[0].reach(name) for name in generated[0].names]
    assert [4 * reach.ring + reach.angle for reach in reaches] == [0, 1, 2, 3, 4, 5]
    known = [SYNTHETIC.reach(name) for name in SOME]

    def arrivals(of: list) -> np.ndarray:
        return np.array([palm_centre(r.positions, r.quaternions)[np.searchsorted(r.times, r.reached)] for r in of])

    low, high = np.quantile(arrivals(known), [0.01, 0.99], axis=0)
    assert (np.abs(arrivals(reaches) - (low + high) / 2) < high - low).all()
    assert not {tuple(reach.positions[0]) for reach in known} & {tuple(reach.positions[0]) for reach in reaches}


def test_the_arriving_palm_sees_a_known_offset(generated: tuple[ReachSource, list[Setting]]):
    """All known settings have one offset, 22.4 mm long: it turns with the palm, and its length stays."""
    source, settings = generated
    assert [one.reach for one in settings] == list(source.names)
    assert np.hypot(*np.array([[one.offset_x, one.offset_y] for one in settings]).T) == pytest.approx(0.02236, abs=1e-5)
    known = [SYNTHETIC.reach(name) for name in SOME]
    seen = [np.angle(complex(0.02, 0.01)) - generated_reaches._heading(reach) for reach in known]
    new = [np.arctan2(s.offset_y, s.offset_x) - generated_reaches._heading(source.reach(s.reach)) for s in settings]
    assert all(np.isclose(np.exp(1j * angle), np.exp(1j * np.array(seen)), atol=1e-9).any() for angle in new)
    assert len({one.duration_noise for one in settings}) == len(settings)
    assert all(len(source.path(one)) > 50 for one in settings)


def test_offsets_stay_within_the_range_of_all_settings():
    corner = [Setting(name, OFFSET, OFFSET, 0.5) for name in SOME]
    _, settings = generated_reaches.generate(SYNTHETIC, corner, 20)
    assert np.abs([[one.offset_x, one.offset_y] for one in settings]).max() == OFFSET


def test_the_heading_is_the_horizontal_direction_from_the_carrier_to_the_palm():
    """The palm's centre lies ahead and a little to the side."""
    reach = SYNTHETIC.reach(SOME[0])
    at = np.searchsorted(reach.times, reach.reached)
    ahead = palm_centre(reach.positions, reach.quaternions)[at] - reach.positions[at]
    assert generated_reaches._heading(reach) == pytest.approx(np.arctan2(ahead[1], ahead[0]), abs=0.35)


def test_too_few_start_regions_are_named():
    with pytest.raises(TooFewRegions, match="too few for a model"):
        generated_reaches.generate(SOURCE, SETTINGS, 3)
    with pytest.raises(TooFewRegions, match="start in 0 of 16 regions"):
        generated_reaches.generate(open_source("minjerk"), SETTINGS, 3)
