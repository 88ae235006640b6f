"""The parameters of the synthetic model: what they mean, and the .npz file that stores them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import IO

import numpy as np

ANGLES = 4  # Angles in each ring: region = ANGLES x ring + angle.
REGIONS = 16
STRETCHES = 7  # Parts of a reach's duration; the fourth ends when the hand arrives.
ARRIVED = 4
WEIGHTS = 32  # B-spline weights per channel.
KNOTS = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, WEIGHTS - 2), np.ones(3)])
CHANNELS = 6  # Three for the position [m], three for the orientation [ARM x rad].
ARM = 0.1  # [m] factor that makes rotation vectors comparable with positions.
STAGES = (0.1, 0.2, 0.3, 0.55)  # Phases at which the noise levels of a reach change.
NOISES = 2 * (len(STAGES) + 1)  # Noise levels of a reach: in position and in orientation, for each stage.
SIZES = 2 * (WEIGHTS - 1)  # Sizes of the steps between weights: in position and in orientation.
SPREAD = np.linspace(-2.8, 2.8, 29)  # Normal scores at which quantiles are stored.
CENTRE = 1.5  # Mean of the ring numbers, and of the angle numbers.
HALF = ("sessions", "slopes", "components")  # Parameters in half precision: these effects need three digits.


@dataclass(frozen=True, slots=True)
class Parameters:
    """The fitted model: means, directions, scales and quantiles over many recordings. It contains no recording.

    A reach has F features: STRETCHES log durations [log s], NOISES and SIZES logs [log m], then WEIGHTS x CHANNELS
    weights. There are C components, Q quantiles at SPREAD, U subjects, and S sessions (one subject in one condition of
    the recordings).
    """

    reference: np.ndarray  # (4,) mean grasping orientation, unit quaternion wxyz.
    phases: np.ndarray  # (STRETCHES + 1,) phases at the ends of the stretches.
    regions: np.ndarray  # (REGIONS, F) means.
    sessions: np.ndarray  # (S, F) effects.
    subjects: np.ndarray  # (S,) subject of each session.
    slopes: np.ndarray  # (U, 2, F) effects of ring and angle for each subject.
    components: np.ndarray  # (C, F) directions in which reaches vary.
    left: np.ndarray  # (F,) standard deviation of the residual after the components.
    marginals: np.ndarray  # (C, Q) quantiles of standardised scores.
    subject_scales: np.ndarray  # (U, C) standard deviations of scores.
    ring_scales: np.ndarray  # (rings, C) factors on these.
    drawn: np.ndarray  # (D, Q) quantiles of the first D features, as the components draw them.
    recorded: np.ndarray  # (D, Q) quantiles of the same features in the recordings. Features are mapped to these.
    lag_taps: np.ndarray  # (U, T) filter from white noise to successive lags, as normal scores.
    lags: np.ndarray  # (U, Q) quantiles of lags [s].
    noise_taps: np.ndarray  # (T,) filter from white noise to successive noise, as normal scores.
    noise_profile: np.ndarray  # (bins, CHANNELS) size of noise by phase, relative to the level of a reach.
    noise: np.ndarray  # (CHANNELS, Q) quantiles of standardised noise.


@cache
def shipped_parameters() -> Parameters:
    """The parameters that come with the package."""
    with files("dextron_bench").joinpath("data/synthetic-reaches.npz").open("rb") as file:
        return load(file)


def load(file: str | IO[bytes]) -> Parameters:
    """Reads parameters from a .npz file. Raises KeyError if one is missing."""
    with np.load(file, allow_pickle=False) as arrays:
        return _in_double_precision({field.name: arrays[field.name] for field in fields(Parameters)})


def save(parameters: Parameters, file: Path) -> None:
    """Writes parameters to a .npz file without pickles. Equal parameters give equal bytes."""
    np.savez_compressed(file, allow_pickle=False, **_in_stored_precision(parameters))


def rounded(parameters: Parameters) -> Parameters:
    """The parameters, rounded to the precision in which they are stored."""
    return _in_double_precision(_in_stored_precision(parameters))


def _in_stored_precision(parameters: Parameters) -> dict[str, np.ndarray]:
    arrays = {field.name: getattr(parameters, field.name) for field in fields(parameters)}
    return {name: array.astype(_stored_type(name, array)) for name, array in arrays.items()}


def _in_double_precision(arrays: dict[str, np.ndarray]) -> Parameters:
    return Parameters(**{k: a.astype(float) if a.dtype.kind == "f" else a for k, a in arrays.items()})


def _stored_type(name: str, array: np.ndarray) -> np.dtype:
    if array.dtype.kind == "i":
        return np.dtype(np.int16)
    return np.dtype(np.float16 if name in HALF else np.float32)
