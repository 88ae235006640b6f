"""Unit quaternions: known rotations, and laws that hold for all of them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dextron_bench.reaches import rotation

HALF = np.sqrt(0.5)
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
ABOUT_X = np.array([HALF, HALF, 0.0, 0.0])  # Quarter turns.
ABOUT_Z = np.array([HALF, 0.0, 0.0, HALF])

quaternions = (
    arrays(float, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: float(np.linalg.norm(q)) > 1e-3).map(rotation.unit)
)
vectors = arrays(float, 3, elements=st.floats(-10.0, 10.0))


def about_z(angles: np.ndarray) -> np.ndarray:
    """Rotations (n, 4) about z by angles [rad] (n,)."""
    zero = np.zeros_like(angles)
    return np.stack([np.cos(angles / 2), zero, zero, np.sin(angles / 2)], axis=-1)


def test_a_quarter_turn_about_z_maps_x_to_y():
    np.testing.assert_allclose(rotation.rotate(ABOUT_Z, np.array([1.0, 0.0, 5.0])), [0.0, 1.0, 5.0], atol=1e-15)


def test_a_product_applies_its_right_factor_first():
    product = rotation.multiply(ABOUT_X, ABOUT_Z)  # z first: x to y; then x: y to z.
    np.testing.assert_allclose(rotation.rotate(product, np.array([1.0, 0.0, 0.0])), [0.0, 0.0, 1.0], atol=1e-15)


def test_log_is_half_the_rotation_vector():
    np.testing.assert_allclose(rotation.log(ABOUT_Z), [0.0, 0.0, np.pi / 4])
    np.testing.assert_array_equal(rotation.log(IDENTITY), [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(rotation.exp(np.zeros(3)), IDENTITY)


def test_slerp_has_constant_speed():
    u = np.array([0.0, 0.25, 0.5, 1.0])
    between = rotation.slerp(np.tile(IDENTITY, (4, 1)), np.tile(ABOUT_Z, (4, 1)), u)
    np.testing.assert_allclose(between, about_z(u * np.pi / 2), atol=1e-15)


def test_squad_follows_a_rotation_at_constant_speed_exactly():
    times = np.arange(8) * 0.01
    turns = about_z(times * 20.0)
    queries = np.linspace(0.0, times[-1], 101)
    interpolated = rotation.squad(times, turns, rotation.squad_controls(turns), queries)
    np.testing.assert_allclose(interpolated, about_z(queries * 20.0), atol=1e-14)


def test_squad_passes_through_its_samples_and_is_smooth_between_them():
    rng = np.random.default_rng(0)
    times = np.arange(12) * 0.1
    turns = rotation.continuous(rotation.unit(np.cumsum(rng.normal(0, 0.2, (12, 4)), axis=0) + IDENTITY))
    controls = rotation.squad_controls(turns)
    np.testing.assert_allclose(rotation.squad(times, turns, controls, times), turns, atol=1e-12)
    e = 1e-5
    before, sample, after = (rotation.squad(times, turns, controls, times[2:-2] + d) for d in (-e, 0.0, e))
    np.testing.assert_allclose((sample - before) / e, (after - sample) / e, atol=2e-2)


def test_squad_is_constant_outside_its_times():
    times, turns = np.array([0.0, 1.0, 2.0]), about_z(np.array([0.0, 0.5, 1.0]))
    ends = rotation.squad(times, turns, rotation.squad_controls(turns), np.array([-1.0, 3.0]))
    np.testing.assert_allclose(ends, turns[[0, 2]], atol=1e-15)


def test_continuous_undoes_flipped_signs():
    turns = about_z(np.linspace(0.0, 3.0, 20))
    signs = np.where(np.random.default_rng(1).random(20) < 0.5, -1.0, 1.0)
    signs[0] = 1.0
    np.testing.assert_array_equal(rotation.continuous(turns * signs[:, None]), turns)


def test_the_mean_does_not_depend_on_signs():
    turns = about_z(np.array([0.2, 0.4, 0.6]))
    np.testing.assert_allclose(rotation.mean(turns), about_z(np.array(0.4)), atol=1e-12)
    turns[1] *= -1.0
    np.testing.assert_allclose(rotation.mean(turns), about_z(np.array(0.4)), atol=1e-12)


@given(quaternions, quaternions)
def test_products_stay_unit(a: np.ndarray, b: np.ndarray):
    assert abs(np.linalg.norm(rotation.multiply(a, b)) - 1.0) < 1e-14


@given(quaternions)
def test_the_conjugate_is_the_inverse(q: np.ndarray):
    np.testing.assert_allclose(rotation.multiply(q, rotation.conjugate(q)), IDENTITY, atol=1e-14)


@given(quaternions, vectors)
def test_a_rotation_keeps_length_and_has_an_inverse(q: np.ndarray, v: np.ndarray):
    turned = rotation.rotate(q, v)
    np.testing.assert_allclose(np.linalg.norm(turned), np.linalg.norm(v), atol=1e-12)
    np.testing.assert_allclose(rotation.rotate(rotation.conjugate(q), turned), v, atol=1e-12)


@given(quaternions, quaternions, vectors)
def test_rotation_by_a_product_is_two_rotations(a: np.ndarray, b: np.ndarray, v: np.ndarray):
    twice = rotation.rotate(a, rotation.rotate(b, v))
    np.testing.assert_allclose(rotation.rotate(rotation.multiply(a, b), v), twice, atol=1e-12)


@given(quaternions)
def test_exp_inverts_log_except_for_a_full_turn(q: np.ndarray):
    restored = rotation.exp(rotation.log(q))
    if np.linalg.norm(q[1:]) < 1e-9:  # No turn or a full turn, which are the same rotation.
        restored = np.copysign(restored, q)
    np.testing.assert_allclose(restored, q, atol=1e-11)


@given(quaternions, quaternions, st.floats(0.0, 1.0))
def test_slerp_stays_unit_and_begins_and_ends_at_its_arguments(a: np.ndarray, b: np.ndarray, u: float):
    between = rotation.slerp(np.stack([a, a, a]), np.stack([b, b, b]), np.array([0.0, u, 1.0]))
    np.testing.assert_allclose(np.linalg.norm(between, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(between[0], a, atol=1e-11)
    np.testing.assert_allclose(abs(between[2] @ b), 1.0, atol=1e-11)  # The same rotation; its sign may differ.
