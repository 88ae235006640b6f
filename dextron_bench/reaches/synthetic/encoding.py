"""A recorded reach in the terms of the synthetic model: stretches of time, spline weights, lags, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, PchipInterpolator

from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.synthetic.generator import ARM, KNOTS, STAGES, WEIGHTS

REACHED_SHARES = (0.05, 0.5, 0.9)  # Of the way to the bottle: where stretches end before the hand arrives.
LIFTED_SHARES = (0.1, 0.5)  # Of the way after it.
STIFFNESS = 0.03  # Penalty on bends of the weights; without it weights ring where a hand at rest sets off.
ROUGH = 0.01  # The same where only the way travelled is wanted.
IDLE = 0.005  # Share of the fastest motion that does not count as travel.
GRID = 401  # Moments at which the way travelled is summed.
PASSES = 3  # Of fitting lags, and weights to them.
SLOW = 0.15  # [m/s] below which a lag cannot be told from noise, and counts for little.
LONGEST_LAG = 0.012  # [s]
SILENT = 3e-6  # [m] noise added before a logarithm is taken.


@dataclass(frozen=True, slots=True)
class Encoded:
    """One reach of n samples in the model's terms."""

    stretches: np.ndarray  # (STRETCHES,) log durations [log s].
    weights: np.ndarray  # (WEIGHTS, CHANNELS) [m].
    lags: np.ndarray  # (n,) [s].
    noise: np.ndarray  # (n, CHANNELS) [m].
    phase: np.ndarray  # (n,)

    def features(self) -> np.ndarray:
        """Features (F,) as `Parameters` orders them; a noise level without samples is NaN."""
        steps = np.diff(self.weights, axis=0).reshape(-1, 2, 3)
        sizes = np.log(np.sqrt((steps * steps).sum(axis=-1)) + 1e-6)
        return np.concatenate([self.stretches, self.levels(), sizes.ravel(), self.weights.ravel()])

    def levels(self) -> np.ndarray:
        """Log root mean square of noise (NOISES,) in position and orientation, for each stage [log m]."""
        stage = np.searchsorted(STAGES, self.phase, side="right")
        parts = [self.noise[stage == k].reshape(-1, 2, 3) for k in range(len(STAGES) + 1)]
        empty = np.full(2, np.nan)
        return np.concatenate(
            [np.log(np.sqrt((part**2).mean(axis=(0, 2))) + SILENT) if len(part) > 1 else empty for part in parts]
        )


def grasping_orientation(reaches: Sequence[Reach]) -> np.ndarray:
    """Mean orientation (4,) at the moment of arrival."""
    return rotation.mean(np.array([r.quaternions[np.searchsorted(r.times, r.reached)] for r in reaches]))


def encode(reach: Reach, reference: np.ndarray, stretches: np.ndarray, phases: np.ndarray) -> Encoded:
    """Fits weights and lags in turn to a reach whose log stretches (STRETCHES,) end at `phases`."""
    marks = np.concatenate([[0.0], np.cumsum(np.exp(stretches))])
    warp = PchipInterpolator(marks, phases)
    poses = channels(reach, reference)
    on_time = basis(warp(np.clip(reach.times, 0.0, marks[-1])))
    lags = np.zeros(len(poses))
    weights, noise = explain(warp, reach.times + lags, poses)
    for _ in range(PASSES):
        speed = np.gradient(on_time @ weights, reach.times, axis=0)
        late = (noise * speed).sum(axis=1) / ((speed * speed).sum(axis=1) + SLOW**2)
        lags = np.clip(lags + late, -LONGEST_LAG, LONGEST_LAG)
        weights, noise = explain(warp, reach.times + lags, poses)
    return Encoded(stretches, weights, lags, noise, np.clip(warp(np.minimum(reach.times, marks[-1])), 0.0, 1.0))


def explain(warp: PchipInterpolator, times: np.ndarray, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights (WEIGHTS, CHANNELS) of poses (n, CHANNELS) shown at times [s] (n,), and what they leave."""
    splines = basis(warp(np.clip(times, warp.x[0], warp.x[-1])))
    weights = fit_weights(splines, poses, STIFFNESS)
    return weights, poses - splines @ weights


def channels(reach: Reach, reference: np.ndarray) -> np.ndarray:
    """Positions [m] and rotation vectors from the reference [ARM x rad], shape (n, CHANNELS)."""
    signs = np.where((reach.quaternions * reference).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    turns = rotation.log(rotation.multiply(rotation.conjugate(reference), signs * reach.quaternions))
    return np.concatenate([reach.positions, 2.0 * ARM * turns], axis=1)


def log_stretches(reach: Reach) -> np.ndarray:
    """Log durations (STRETCHES,) [log s] between shares of the way to the bottle, and of the way after it."""
    grid = np.linspace(0.0, 1.0, GRID)
    weights = fit_weights(basis(reach.times / reach.duration), reach.positions, ROUGH)
    moved = np.sqrt((np.diff(basis(grid) @ weights, axis=0) ** 2).sum(axis=1))
    way = np.concatenate([[0.0], np.cumsum(np.maximum(moved - IDLE * moved.max(), 0.0))])
    arrived = reach.reached / reach.duration
    there = np.interp(arrived, grid, way)
    before = [np.interp(share * there, way, grid) for share in REACHED_SHARES]
    after = [np.interp(there + share * (way[-1] - there), way, grid) for share in LIFTED_SHARES]
    return np.log(np.diff([0.0, *before, arrived, *after, 1.0]) * reach.duration)


def basis(phase: np.ndarray) -> np.ndarray:
    """Cubic B-splines (n, WEIGHTS) at phases (n,), clipped to [0, 1]."""
    return BSpline.design_matrix(np.clip(phase, 0.0, 1.0), KNOTS, 3).toarray()


def fit_weights(splines: np.ndarray, poses: np.ndarray, stiffness: float) -> np.ndarray:
    """Least-squares weights (WEIGHTS, k) of poses (n, k) in splines (n, WEIGHTS), with a penalty on bends."""
    bends = np.diff(np.eye(WEIGHTS), 2, axis=0)
    return np.linalg.solve(splines.T @ splines + stiffness * bends.T @ bends, splines.T @ poses)
