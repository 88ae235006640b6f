"""The source `minjerk`: its geometry, its law of motion, and the success of the paper's expert."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dextron_bench.errors import BadInput
from dextron_bench.experts import policies
from dextron_bench.reaches.minjerk import (
    LIFT_STEPS,
    REACH_STEPS,
    Draw,
    MinjerkSource,
    band_index,
    carrier_positions,
    minimum_jerk_leg,
)
from dextron_bench.reaches.reach import palm_centre
from dextron_bench.reaches.setting import Setting, UnknownReach
from dextron_bench.reaches.sources import open_source
from dextron_bench.world import task
from dextron_bench.world.engine import Engine

FIRST_OF_123 = [-0.106000607, -0.449409143, 0.1]  # [m] frozen, since published results use the name.


def setting(name: str) -> Setting:
    """The only setting of a reach."""
    return Setting(name, 0.0, 0.0, 0.0)


def test_the_source_has_a_thousand_reaches():
    source = open_source("minjerk")
    assert (source.name, len(source.names)) == ("minjerk", 1000)
    assert source.names[0] == "minjerk-000000"
    assert source.names[-1] == "minjerk-000999"


def test_settings_are_drawn_from_the_names_and_have_no_noise():
    source, rng = MinjerkSource(), np.random.default_rng(0)
    settings = [source.sample(rng) for _ in range(200)]
    assert all((s.offset_x, s.offset_y, s.duration_noise) == (0.0, 0.0, 0.0) for s in settings)
    assert len({s.reach for s in settings} & set(source.names)) > 150
    assert settings[0] == source.sample(np.random.default_rng(0))


def test_the_path_of_a_name_never_changes():
    np.testing.assert_allclose(MinjerkSource().path(setting("minjerk-000123")).positions[0], FIRST_OF_123, atol=1e-9)


def test_larger_numbers_are_valid_and_other_names_are_not():
    source = MinjerkSource()
    assert len(source.path(setting("minjerk-123456"))) == 417
    for name in ("minjerk-1", "minjerk-0000001", "01_fl_01", "Minjerk-000001", "minjerk-000001\n"):
        with pytest.raises(UnknownReach, match="minjerk-000000, minjerk-000001"):
            source.path(setting(name))
        with pytest.raises(UnknownReach):
            source.stratum(name)


@pytest.mark.parametrize("noise", [(0.01, 0.0, 0.0), (0.0, -0.01, 0.0), (0.0, 0.0, 0.5)])
def test_offsets_and_noise_are_refused(noise: tuple[float, float, float]):
    with pytest.raises(BadInput, match="set all three to 0"):
        MinjerkSource().path(Setting("minjerk-000001", *noise))


def test_start_via_point_and_top_agree_with_a_calculation_by_hand():
    draw = Draw(radius=0.5, theta=np.pi / 10, height=0.01)
    positions = carrier_positions(draw)
    np.testing.assert_allclose(positions[0], [-0.5 * 0.3090169944, -0.5 * 0.9510565163, 0.1], atol=1e-9)
    np.testing.assert_allclose(positions[250], [-0.045, -0.1, 0.11], atol=1e-5)  # After 5 s.
    np.testing.assert_allclose(positions[-1], [-0.045, -0.1, 0.31], atol=1e-5)
    assert len(positions) == 1 + 250 + 166  # Half of ten seconds, then a third.
    assert MinjerkSource().duration(setting("minjerk-000000")) == pytest.approx(8.32)
    np.testing.assert_allclose(np.ptp(positions[250:, :2], axis=0), 0.0, atol=1e-5)  # Straight up.


def test_the_palm_centre_comes_within_the_distance_at_which_every_expert_closes():
    path = MinjerkSource().path(setting("minjerk-000007"))
    centre = palm_centre(path.positions, path.quaternions)[250]
    np.testing.assert_allclose(centre[:2], [-0.015, 0.005], atol=1e-4)
    assert np.hypot(*centre[:2]) < policies.ALWAYS_CLOSE


def test_a_leg_is_the_minimum_jerk_polynomial():
    u = np.arange(1, 251) / 250 / 1.01  # The law aims to arrive at the end of its slack.
    exact = u**3 * (10 - 15 * u + 6 * u**2)
    positions = minimum_jerk_leg(np.zeros(3), np.array([1.0, 0.0, -2.0]), 250)
    np.testing.assert_allclose(positions[:, 0], exact, atol=0.003)
    np.testing.assert_allclose(positions[:, 2], -2.0 * positions[:, 0], atol=1e-12)
    assert (np.diff(positions[:245, 0]) > 0).all()


@given(st.integers(0, 999_999))
def test_every_draw_is_in_its_ranges(number: int):
    draw = Draw.from_name(f"minjerk-{number:06d}")
    assert 0.25 <= draw.radius <= 0.60
    assert np.pi / 14 <= draw.theta <= np.pi / 7
    assert abs(draw.height) <= 0.02


def test_draws_are_uniform():
    draws = np.array([(d.radius, d.theta, d.height) for d in map(Draw.from_name, MinjerkSource().names)])
    low, high = np.array([[0.25, np.pi / 14, -0.02], [0.60, np.pi / 7, 0.02]])
    shares = (draws - low) / (high - low)
    np.testing.assert_allclose(shares.mean(axis=0), 0.5, atol=0.03)
    np.testing.assert_allclose(shares.var(axis=0), 1 / 12, atol=0.01)
    assert np.abs(np.corrcoef(shares.T) - np.eye(3)).max() < 0.1


def test_start_regions_go_from_near_to_far_and_from_x_to_y():
    assert [band_index(r, 0.25, 0.60) for r in (0.25, 0.33, 0.34, 0.43, 0.52, 0.60)] == [0, 0, 1, 2, 3, 3]
    source = MinjerkSource()
    strata = [source.stratum(name) for name in source.names]
    assert {s.subject for s in strata} == {"minjerk"}
    assert {(s.ring, s.angle) for s in strata} == {(r, a) for r in range(4) for a in range(4)}
    widest = max(source.names, key=lambda name: Draw.from_name(name).theta)
    assert source.stratum(widest).angle == 0  # Nearest to the -x side.


@pytest.mark.slow
def test_the_papers_expert_lifts_the_bottle():
    names = [name for name in MinjerkSource().names if abs(Draw.from_name(name).height) < 0.01][:3]
    engine, ids = Engine(len(names), threads=1), np.arange(len(names))
    states = engine.begin(ids, [MinjerkSource().path(setting(name)) for name in names])
    first, scores, actions = task.distance(states), np.zeros(len(names)), np.zeros((len(names), 1))
    gain, critical = np.full(len(names), 2.0), np.full(len(names), 0.15)
    for _ in range(375):
        step = engine.step(ids, actions)
        scores += step.rewards
        closing = policies.is_closing(task.distance(step.states), first, critical)
        actions = policies.closing_speeds(task.closure(step.states), closing, gain)
    assert scores.tolist() == [task.SUCCESS] * 3


def test_reach_and_lift_take_a_half_and_a_third_of_an_episode():
    """The package `reaches` does not import the world, so both contain the limit of 500 steps."""
    assert (REACH_STEPS, LIFT_STEPS) == (task.STEP_LIMIT // 2, task.STEP_LIMIT // 3)
