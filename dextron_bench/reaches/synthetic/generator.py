"""The built-in default source: human-like reaches drawn from a probabilistic model of the recorded ones.

A reach is a movement primitive (a ProMP; Paraschos et al., 2013): B-spline weights of position and orientation
over a phase that aligns seven stretches of time, drawn as region + session + components. What the sensor adds
is drawn too: poses come a little early or late, and with noise. `synthetic_fit` makes the parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from importlib.resources import files
from typing import IO

import numpy as np
from scipy.interpolate import BSpline, PchipInterpolator

from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import DECIMALS, Reach
from dextron_bench.reaches.setting import ReachSource, Stratum, UnknownReach

COUNT = 1600  # Reaches in the source: 100 for each start region.
ANGLES = 4  # Angles of a ring: region = ANGLES x ring + angle.
REGIONS = 16
SAMPLING = 0.01  # [s] between samples.
STREAM = 575  # Together with a reach's number, the seed of everything random about it.
STRETCHES = 7  # Of time; the fourth ends when the hand arrives.
ARRIVED = 4
WEIGHTS = 32  # B-spline weights per channel.
KNOTS = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, WEIGHTS - 2), np.ones(3)])
CHANNELS = 6  # Three of position [m], three of orientation [ARM x rad].
ARM = 0.1  # [m] turns a rotation vector into lengths comparable with positions.
GRASP = 20  # Weight that stays as drawn, about when the hand arrives; the path is built outward from it.
ROUNDS = 4  # Of fitting steps to their sizes and to where they lead.
STAGES = (0.1, 0.2, 0.3, 0.55)  # Phases between which a reach keeps its noise levels.
NOISES = 2 * (len(STAGES) + 1)  # Levels of a reach's noise: in position and in orientation, for each stage.
SIZES = 2 * (WEIGHTS - 1)  # Sizes of the steps between weights: in position and in orientation.
SPREAD = np.linspace(-2.8, 2.8, 29)  # Normal scores at which quantiles are kept.
CENTRE = 1.5  # Mean of the rings, and of the angles.


@dataclass(frozen=True, slots=True)
class Parameters:
    """The fitted model. Means, directions, scales and quantiles over many recordings; no recording is in it.

    F features: STRETCHES log durations [log s], NOISES and SIZES logs [log m], then WEIGHTS x CHANNELS weights.
    C components, Q quantiles at SPREAD, U subjects, S sessions (a subject in one condition of the recordings).
    """

    reference: np.ndarray  # (4,) mean grasping orientation, unit quaternion wxyz.
    phases: np.ndarray  # (STRETCHES + 1,) phase at the ends of the stretches.
    regions: np.ndarray  # (REGIONS, F) means.
    sessions: np.ndarray  # (S, F) effects.
    subjects: np.ndarray  # (S,) subject of each session.
    slopes: np.ndarray  # (U, 2, F) effects of ring and angle that are a subject's own.
    components: np.ndarray  # (C, F) directions in which reaches vary.
    left: np.ndarray  # (F,) standard deviation of what the components leave.
    marginals: np.ndarray  # (C, Q) quantiles of standardised scores.
    subject_scales: np.ndarray  # (U, C) standard deviations of scores.
    ring_scales: np.ndarray  # (rings, C) factors on them.
    drawn: np.ndarray  # (D, Q) quantiles of the first D features as components draw them,
    recorded: np.ndarray  # (D, Q) and as recorded; all features but the weights are mapped from one to the other.
    lag_taps: np.ndarray  # (U, T) how successive lags, as normal scores, come of white noise.
    lags: np.ndarray  # (U, Q) quantiles of lags [s].
    noise_taps: np.ndarray  # (T,) how successive noise, as normal scores, comes of white noise.
    noise_profile: np.ndarray  # (bins, CHANNELS) size of noise by phase, relative to a reach's level.
    noise: np.ndarray  # (CHANNELS, Q) quantiles of standardised noise.


@cache
def shipped() -> Parameters:
    """The parameters that come with the package."""
    with files("dextron_bench").joinpath("data/synthetic-reaches.npz").open("rb") as file:
        return load(file)


def load(file: str | IO[bytes]) -> Parameters:
    """Parameters from a .npz file; raises KeyError where one is missing."""
    with np.load(file, allow_pickle=False) as arrays:
        named = {field.name: arrays[field.name] for field in fields(Parameters)}
    return Parameters(**{k: a.astype(float) if a.dtype.kind == "f" else a for k, a in named.items()})


def draw_features(rng: np.random.Generator, p: Parameters, region: int, session: int) -> np.ndarray:
    """Features (F,) of one reach as the components draw them."""
    subject, (ring, angle) = p.subjects[session], divmod(region, ANGLES)
    normal = rng.standard_normal(len(p.components))
    scores = mapped(normal, SPREAD, p.marginals) * p.subject_scales[subject] * p.ring_scales[ring]
    slopes = p.slopes[subject, 0] * (ring - CENTRE) + p.slopes[subject, 1] * (angle - CENTRE)
    mean = p.regions[region] + p.sessions[session] + slopes
    return mean + (scores[:, None] * p.components).sum(axis=0) + p.left * rng.standard_normal(len(p.left))


def mapped(values: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Values (n,) carried from quantiles (n, Q) or (Q,) to others (n, Q): piecewise linear, and level beyond."""
    source, rows = np.broadcast_to(source, target.shape), np.arange(len(values))
    i = np.clip((source <= values[:, None]).sum(axis=1) - 1, 0, source.shape[1] - 2)
    width = source[rows, i + 1] - source[rows, i]
    share = np.clip((values - source[rows, i]) / width, 0.0, 1.0)
    return target[rows, i] + share * (target[rows, i + 1] - target[rows, i])


def generate(number: int, p: Parameters) -> Reach:
    """The reach of a number, the same wherever it is made: start region number mod REGIONS, then sessions in turn."""
    rng = np.random.default_rng([STREAM, number])
    region, session = place(number, p)
    features = draw_features(rng, p, region, session)
    features[: len(p.drawn)] = mapped(features[: len(p.drawn)], p.drawn, p.recorded)
    stretches, levels, rest = np.split(features, [STRETCHES, STRETCHES + NOISES])
    marks = np.concatenate([[0.0], np.cumsum(np.exp(stretches))])
    samples = round(marks[-1] / SAMPLING) + 1
    times = np.arange(samples) * SAMPLING
    marks *= times[-1] / marks[-1]
    early = times + sensor_lags(rng, samples, p, p.subjects[session])
    phase = np.clip(PchipInterpolator(marks, p.phases)(np.clip(early, 0.0, times[-1])), 0.0, 1.0)
    poses = BSpline(KNOTS, shape(rest), 3)(phase) + sensor_noise(rng, phase, np.exp(levels), p)
    turned = rotation.multiply(p.reference, rotation.exp(poses[:, 3:] / (2.0 * ARM)))
    quaternions = rotation.continuous(np.round(rotation.unit(turned), DECIMALS))
    ring, angle = divmod(region, ANGLES)
    return Reach(
        name=f"synthetic-{number:04d}",
        times=np.round(times, DECIMALS),
        positions=np.round(poses[:, :3], DECIMALS),
        quaternions=quaternions,
        reached=round(float(marks[ARRIVED]), DECIMALS),
        subject=f"s{p.subjects[session]}",
        ring=ring,
        angle=angle,
    )


def place(number: int, p: Parameters) -> tuple[int, int]:
    """Start region and session of a reach's number."""
    return number % REGIONS, number // REGIONS % len(p.sessions)


def shape(features: np.ndarray) -> np.ndarray:
    """Weights (WEIGHTS, CHANNELS) of log step sizes (SIZES,) followed by weights as drawn.

    The steps between weights keep the directions drawn, and take their sizes: drawn linearly, weights of a
    hand at rest wander as much as recorded ones do on the average, while most recorded hands lie still.
    """
    sizes = np.exp(features[:SIZES]).reshape(WEIGHTS - 1, 2, 1)
    drawn = features[SIZES:].reshape(WEIGHTS, 2, 3)
    steps = np.diff(drawn, axis=0)
    before = resized(steps[:GRASP], sizes[:GRASP])
    after = resized(steps[GRASP:], sizes[GRASP:])
    weights = [
        drawn[GRASP] - np.cumsum(before[::-1], axis=0)[::-1],
        drawn[GRASP : GRASP + 1],
        drawn[GRASP] + np.cumsum(after, axis=0),
    ]
    return np.concatenate(weights).reshape(WEIGHTS, CHANNELS)


def resized(steps: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Steps (n, 2, 3) made to have sizes (n, 2, 1) while they still lead about where they led."""
    made = steps
    for _ in range(ROUNDS):
        made = made + (steps.sum(axis=0) - made.sum(axis=0)) * sizes / sizes.sum(axis=0)
        made = made * (sizes / np.sqrt((made * made).sum(axis=-1, keepdims=True)))
    return made


def sensor_lags(rng: np.random.Generator, n: int, p: Parameters, subject: int) -> np.ndarray:
    """By how much each of n samples shows a later pose than it should [s], shape (n,)."""
    taps = p.lag_taps[subject]
    return np.interp(echoed(rng.standard_normal(n + len(taps) - 1), taps), SPREAD, p.lags[subject])


def sensor_noise(rng: np.random.Generator, phase: np.ndarray, levels: np.ndarray, p: Parameters) -> np.ndarray:
    """Noise [m] (n, CHANNELS) at phases (n,) of a reach whose noise has levels [m] (NOISES,)."""
    normal = echoed(rng.standard_normal((len(phase) + len(p.noise_taps) - 1, CHANNELS)), p.noise_taps)
    standard = np.stack([np.interp(z, SPREAD, level) for z, level in zip(normal.T, p.noise, strict=True)], axis=1)
    bins = np.minimum((phase * len(p.noise_profile)).astype(int), len(p.noise_profile) - 1)
    stage = np.searchsorted(STAGES, phase, side="right")
    return standard * p.noise_profile[bins] * levels.reshape(-1, 2)[stage].repeat(3, axis=1)


def echoed(white: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """White noise (n + T - 1, ...) filtered by taps (T,), the latest first; shape (n, ...). No BLAS, for equal sums."""
    n = len(white) - len(taps) + 1
    out = np.zeros((n, *white.shape[1:]))
    for i, tap in enumerate(taps):
        out += tap * white[len(taps) - 1 - i :][:n]
    return out


class SyntheticSource(ReachSource):
    """The source `synthetic`: COUNT reaches, each made when it is asked for."""

    def __init__(self) -> None:
        super().__init__("synthetic", ())
        self.names: tuple[str, ...] = tuple(f"synthetic-{number:04d}" for number in range(COUNT))
        self._numbers = {name: number for number, name in enumerate(self.names)}

    def reach(self, name: str) -> Reach:
        """The reach of that name; raises UnknownReach."""
        if name not in self._reaches:
            self._reaches[name] = generate(self._number(name), shipped())
        return self._reaches[name]

    def stratum(self, reach: str) -> Stratum:
        """Virtual subject and start region of a reach; raises UnknownReach."""
        region, session = place(self._number(reach), shipped())
        return Stratum(f"s{shipped().subjects[session]}", *divmod(region, ANGLES))

    def _number(self, name: str) -> int:
        try:
            return self._numbers[name]
        except KeyError:
            raise UnknownReach(name, self.name, self.names) from None


def open_synthetic() -> SyntheticSource:
    """The built-in source of reaches."""
    return SyntheticSource()
