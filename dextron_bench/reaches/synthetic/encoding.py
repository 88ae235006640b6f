"""Encodes a recorded reach as features of the synthetic model: stretches of time, spline weights, lags, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, PchipInterpolator

from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.synthetic.parameters import ARM, KNOTS, STAGES, WEIGHTS

REACHED_SHARES = (0.05, 0.5, 0.9)  # Shares of the distance to the bottle at which stretches end before the arrival.
LIFTED_SHARES = (0.1, 0.5)  # Shares of the distance after the arrival.
STIFFNESS = (
    0.03  # Penalty on bends of the weights; without it the weights oscillate when a resting hand starts to move.
)
ROUGH = 0.01  # The same penalty in the fit that only measures the distance travelled.
IDLE = 0.005  # Share of the greatest speed below which motion does not count as travel.
GRID = 401  # Moments at which the distance travelled is summed.
PASSES = 3  # Alternations between the fit of lags and the fit of weights.
SLOW = 0.15  # [m/s] speed below which a lag is indistinguishable from noise, and has little weight.
LONGEST_LAG = 0.012  # [s]
SILENT = 3e-6  # [m] noise added before a logarithm is taken.


@dataclass(frozen=True, slots=True)
class Encoded:
    """One reach of n samples, encoded."""

    stretches: np.ndarray  # (STRETCHES,) log durations [log s].
    weights: np.ndarray  # (WEIGHTS, CHANNELS) [m].
    lags: np.ndarray  # (n,) [s].
    noise: np.ndarray  # (n, CHANNELS) [m].
    phase: np.ndarray  # (n,)

    def features(self) -> np.ndarray:
        """Features (F,) in the order of `Parameters`; a noise level without samples is NaN."""
        steps = np.diff(self.weights, axis=0).reshape(-1, 2, 3)
        sizes = np.log(np.sqrt((steps * steps).sum(axis=-1)) + 1e-6)
        return np.concatenate([self.stretches, self.levels(), sizes.ravel(), self.weights.ravel()])

    def levels(self) -> np.ndarray:
        """Logs of the root mean square of noise (NOISES,) in position and orientation [log m], for each stage."""
        stage = np.searchsorted(STAGES, self.phase, side="right")
        parts = [self.noise[stage == k].reshape(-1, 2, 3) for k in range(len(STAGES) + 1)]
        empty = np.full(2, np.nan)
        return np.concatenate(
            [np.log(np.sqrt((part**2).mean(axis=(0, 2))) + SILENT) if len(part) > 1 else empty for part in parts]
        )


def grasping_orientation(reaches: Sequence[Reach]) -> np.ndarray:
    """Mean orientation (4,) of the reaches at the moment of arrival."""
    return rotation.mean(np.array([r.quaternions[np.searchsorted(r.times, r.reached)] for r in reaches]))


def encode(reach: Reach, reference: np.ndarray, stretches: np.ndarray, phases: np.ndarray) -> Encoded:
    """Fits weights and lags alternately to a reach whose log stretches (STRETCHES,) end at `phases`."""
    marks = np.concatenate([[0.0], np.cumsum(np.exp(stretches))])
    warp = PchipInterpolator(marks, phases)
    poses = pose_channels(reach, reference)
    splines = basis(warp(np.clip(reach.times, 0.0, marks[-1])))
    lags = np.zeros(len(poses))
    weights, noise = fit_poses(warp, reach.times + lags, poses)
    for _ in range(PASSES):
        speed = np.gradient(splines @ weights, reach.times, axis=0)
        change = (noise * speed).sum(axis=1) / ((speed * speed).sum(axis=1) + SLOW**2)
        lags = np.clip(lags + change, -LONGEST_LAG, LONGEST_LAG)
        weights, noise = fit_poses(warp, reach.times + lags, poses)
    return Encoded(stretches, weights, lags, noise, np.clip(warp(np.minimum(reach.times, marks[-1])), 0.0, 1.0))


def fit_poses(warp: PchipInterpolator, times: np.ndarray, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights (WEIGHTS, CHANNELS) of poses (n, CHANNELS) at times [s] (n,), and the residuals (n, CHANNELS)."""
    splines = basis(warp(np.clip(times, warp.x[0], warp.x[-1])))
    weights = fit_weights(splines, poses, STIFFNESS)
    return weights, poses - splines @ weights


def pose_channels(reach: Reach, reference: np.ndarray) -> np.ndarray:
    """Positions [m] and rotation vectors relative to the reference [ARM x rad], shape (n, CHANNELS)."""
    signs = np.where((reach.quaternions * reference).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    turns = rotation.log(rotation.multiply(rotation.conjugate(reference), signs * reach.quaternions))
    return np.concatenate([reach.positions, 2.0 * ARM * turns], axis=1)


def log_stretches(reach: Reach) -> np.ndarray:
    """Log durations (STRETCHES,) [log s] between shares of the distance to the bottle, and of the distance after it."""
    grid = np.linspace(0.0, 1.0, GRID)
    weights = fit_weights(basis(reach.times / reach.duration), reach.positions, ROUGH)
    moved = np.sqrt((np.diff(basis(grid) @ weights, axis=0) ** 2).sum(axis=1))
    travelled = np.concatenate([[0.0], np.cumsum(np.maximum(moved - IDLE * moved.max(), 0.0))])
    arrival = reach.reached / reach.duration
    reached = np.interp(arrival, grid, travelled)
    before = [np.interp(share * reached, travelled, grid) for share in REACHED_SHARES]
    after = [np.interp(reached + share * (travelled[-1] - reached), travelled, grid) for share in LIFTED_SHARES]
    return np.log(np.diff([0.0, *before, arrival, *after, 1.0]) * reach.duration)


def basis(phase: np.ndarray) -> np.ndarray:
    """Values (n, WEIGHTS) of the cubic B-splines at phases (n,), which are clipped to [0, 1]."""
    return BSpline.design_matrix(np.clip(phase, 0.0, 1.0), KNOTS, 3).toarray()


def fit_weights(splines: np.ndarray, poses: np.ndarray, stiffness: float) -> np.ndarray:
    """Least-squares weights (WEIGHTS, k) of splines (n, WEIGHTS) for poses (n, k), with a penalty on bends."""
    bends = np.diff(np.eye(WEIGHTS), 2, axis=0)
    return np.linalg.solve(splines.T @ splines + stiffness * bends.T @ bends, splines.T @ poses)
