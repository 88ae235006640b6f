"""The source `synthetic`: its reaches never change and are plausible, and its model can be fitted again."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import fields, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import CONTROL_STEP, SETTLE, Reach, palm_centre, path
from dextron_bench.reaches.setting import Stratum, UnknownReach
from dextron_bench.reaches.sources import open_source
from dextron_bench.reaches.synthetic import fitting, generator, parameters
from dextron_bench.reaches.synthetic.encoding import encode, log_stretches

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])

# The start and the end of synthetic-0042. The expert database is wrong if a reach changes.
FIRST = [-0.277646698, -0.307526082, 0.167825246]  # [m]
LAST = [0.559498734, 0.184317163, 0.764682153, -0.261246158]
SAMPLES, REACHED = 166, 0.989021713  # [s]


@pytest.fixture(scope="module")
def source() -> generator.SyntheticSource:
    return generator.open_synthetic()


@pytest.fixture(scope="module")
def few() -> list[Reach]:
    """Made-up recordings: one session of each of two subjects, with every start region."""
    numbers = [*range(16), *range(4 * 16, 5 * 16)]
    reaches = [generator.generate(number, parameters.shipped_parameters()) for number in numbers]
    return [replace(r, name=f"{r.subject}_{i // 16}_{i % 16}") for i, r in enumerate(reaches)]


def test_there_are_100_reaches_for_each_start_region(source: generator.SyntheticSource):
    assert (source.names[0], source.names[-1]) == ("synthetic-0000", "synthetic-1599")
    strata = [source.stratum(name) for name in source.names]
    assert set(Counter((s.ring, s.angle) for s in strata).values()) == {100}
    assert strata[17] == Stratum("s0", 0, 1)  # Number 17: the second session, of the first subject; region 1.
    assert sorted(Counter(s.subject for s in strata)) == [f"s{k}" for k in range(9)]


def test_opening_the_source_generates_no_reach():
    open_source("synthetic")
    start = time.process_time()
    open_source("synthetic")
    assert time.process_time() - start < 0.05


def test_the_stratum_agrees_with_the_reach(source: generator.SyntheticSource):
    for name in source.names[5::333]:
        reach = source.reach(name)
        assert (reach.name, source.stratum(name)) == (name, Stratum(reach.subject, reach.ring, reach.angle))


def test_a_reach_depends_on_its_number_alone(source: generator.SyntheticSource):
    first, again = source.reach("synthetic-0700"), generator.generate(700, parameters.shipped_parameters())
    np.testing.assert_array_equal(first.positions, again.positions)
    np.testing.assert_array_equal(first.quaternions, again.quaternions)
    assert not np.array_equal(first.positions[:50], source.reach("synthetic-0716").positions[:50])


def test_the_shipped_reaches_are_frozen(source: generator.SyntheticSource):
    reach = source.reach("synthetic-0042")
    np.testing.assert_allclose(reach.positions[0], FIRST, atol=2e-9)
    np.testing.assert_allclose(reach.quaternions[-1], LAST, atol=2e-9)
    assert (len(reach.times), reach.reached) == (SAMPLES, pytest.approx(REACHED, abs=2e-9))


def test_reaches_are_plausible(source: generator.SyntheticSource):
    for name in source.names[::40]:
        reach = source.reach(name)
        np.testing.assert_allclose(np.diff(reach.times), 0.01, atol=1e-9)
        np.testing.assert_allclose(np.sqrt((reach.quaternions**2).sum(axis=1)), 1.0, atol=1e-8)
        assert ((reach.quaternions[1:] * reach.quaternions[:-1]).sum(axis=1) > 0).all()
        assert 0.7 < reach.duration < 2.6
        assert 0.3 < reach.reached < reach.duration - SETTLE / 2
        assert reach.positions[:, 2].min() > 0.04  # The hand stays above the table.
        assert reach.positions[-1, 2] > reach.positions[0, 2] + 0.05  # It ends higher than it starts.


@settings(max_examples=15)
@given(number=st.integers(0, 1599), noise=st.floats(-2.0, 3.0), x=st.floats(-0.06, 0.06))
def test_every_path_passes_the_bottle_with_its_offset(number: int, noise: float, x: float):
    reach = generator.generate(number, parameters.shipped_parameters())
    if 2.5 * reach.duration + 0.5 + 0.8 * noise < reach.duration:
        return
    followed = path(reach, x, 0.01, noise)
    steps = np.arange(len(followed)) * CONTROL_STEP
    arrival = reach.reached * (2.5 + (0.5 + 0.8 * noise) / reach.duration)
    settled = (steps >= arrival) & (steps < arrival + SETTLE)
    pose = followed.positions[settled].mean(axis=0), rotation.mean(followed.quaternions[settled])
    np.testing.assert_allclose(palm_centre(*pose)[:2], [x, 0.01], atol=1e-7)


def test_the_error_for_an_unknown_name_lists_names(source: generator.SyntheticSource):
    with pytest.raises(UnknownReach, match="synthetic-0000"):
        source.reach("synthetic-01600")
    with pytest.raises(UnknownReach, match="synthetic-0000"):
        source.stratum("01_fl_01")


def test_new_reaches_are_reaches_that_no_setting_has_used(source: generator.SyntheticSource):
    """Their numbers follow from the generator, and give start regions and subjects as other numbers do."""
    names = source.new_reaches(3, np.random.default_rng(5))
    assert names == source.new_reaches(3, np.random.default_rng(5))
    assert not set(names) & set(source.names)
    number = int(names[0].removeprefix("synthetic-"))
    assert source.reach(names[0]).name == names[0] == generator.generate(number, parameters.shipped_parameters()).name
    assert (source.stratum(names[0]).ring, source.stratum(names[0]).angle) == divmod(number % 16, 4)


def test_values_are_mapped_between_quantiles():
    source, target = np.array([0.0, 1.0, 3.0]), np.array([[10.0, 20.0, 60.0]] * 4)
    mapped = generator.map_quantiles(np.array([0.5, 2.0, -9.0, 9.0]), source, target)
    np.testing.assert_allclose(mapped, [15, 40, 10, 60])


def test_resized_steps_have_the_sizes_and_keep_their_directions():
    steps = np.zeros((2, 2, 3))
    steps[:, 0, 0], steps[:, 1, 1] = (1.0, 3.0), (1.0, 1.0)
    sizes = np.array([[[2.0], [3.0]], [[2.0], [0.5]]])
    resized = generator.resize_steps(steps, sizes)
    np.testing.assert_allclose(resized[:, 0, 0], [2.0, 2.0])
    np.testing.assert_allclose(resized[:, 1, 1], [3.0, 0.5])


def test_the_first_tap_of_the_filter_is_the_latest():
    white, taps = np.array([1.0, 0.0, 0.0, 2.0]), np.array([1.0, 0.5])
    np.testing.assert_allclose(generator.filter_noise(white, taps), [0.5, 0.0, 2.0])


def test_taps_of_a_first_order_process():
    taps = fitting.impulse_response(np.array([1.0, 0.5]))
    np.testing.assert_allclose(taps[:3], np.sqrt(0.75) * np.array([1.0, 0.5, 0.25]))


def test_stretches_add_up_to_the_duration(source: generator.SyntheticSource):
    reach = source.reach("synthetic-0003")
    stretches = np.exp(log_stretches(reach))
    assert stretches.sum() == pytest.approx(reach.duration)
    assert stretches[: parameters.ARRIVED].sum() == pytest.approx(reach.reached)


def test_the_lags_of_the_sensor_are_estimated():
    times = np.arange(151) * 0.01
    lags = 0.003 * np.resize([1.0, -1.0, 0.5, -0.5, 0.0], 151)
    share = np.clip((times + lags) / 1.5, 0.0, 1.0)
    positions = 0.5 * np.stack([share**2 * (3 - 2 * share), 0 * share, share**3], axis=1)
    reach = Reach("steady", times, positions, np.tile(IDENTITY, (151, 1)), 1.0, "s", 0, 0)
    phases = np.linspace(0.0, 1.0, 8)
    estimated = encode(reach, IDENTITY, np.log(np.full(7, 1.5 / 7)), phases).lags[50:120]
    np.testing.assert_allclose(estimated - estimated.mean(), (lags - lags.mean())[50:120], atol=0.0006)


def test_equal_recordings_give_equal_bytes(few: list[Reach], tmp_path: Path):
    first, second = tmp_path / "first.npz", tmp_path / "second.npz"
    model = fitting.fit(few, 0)
    parameters.save(model, first)
    parameters.save(fitting.fit(few, 0), second)
    assert first.read_bytes() == second.read_bytes()
    loaded = parameters.load(str(first))
    for field in fields(model):
        np.testing.assert_array_equal(getattr(loaded, field.name), getattr(model, field.name))


def test_the_shipped_file_is_small_and_has_no_object_and_no_recording():
    file = files("dextron_bench").joinpath("data/synthetic-reaches.npz")
    assert len(file.read_bytes()) < 200_000
    with file.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
        assert {arrays[name].dtype.kind for name in arrays.files} == {"f", "i"}
        assert max(max(arrays[name].shape) for name in arrays.files) < 575
