"""The source `synthetic`, the default: human-like reaches from a probabilistic model of the recorded ones.

A reach is a movement primitive (a ProMP; Paraschos et al., 2013): B-spline weights of position and orientation over a
phase that aligns seven stretches of time. The weights are a sum of region, session and random components. The generator
also draws the errors of the sensor: poses come a little early or late, and have noise. `fitting` computes the
parameters.
"""

from __future__ import annotations

import re

import numpy as np
from scipy.interpolate import BSpline, PchipInterpolator

from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import DECIMALS, Reach
from dextron_bench.reaches.setting import ReachSource, Stratum, UnknownReach
from dextron_bench.reaches.synthetic.parameters import (
    ANGLES,
    ARM,
    ARRIVED,
    CENTRE,
    CHANNELS,
    KNOTS,
    NOISES,
    REGIONS,
    SIZES,
    SPREAD,
    STAGES,
    STRETCHES,
    WEIGHTS,
    Parameters,
    shipped_parameters,
)

COUNT = 1600  # Reaches in the source: 100 for each start region.
NAME = re.compile(r"synthetic-(\d{4}|[1-9]\d{4,11})", re.ASCII)
SAMPLING = 0.01  # [s] between samples.
STREAM = 575  # Seed, together with the number of a reach, of everything random about it.
GRASP = 20  # Index of the weight near the arrival, which stays as drawn; the path is built outward from it.
ROUNDS = 4  # Alternations between the sizes of steps and the sum of steps.


def draw_features(rng: np.random.Generator, p: Parameters, region: int, session: int) -> np.ndarray:
    """Draws the features (F,) of one reach, before they are mapped to the recorded quantiles."""
    subject, (ring, angle) = p.subjects[session], divmod(region, ANGLES)
    normal = rng.standard_normal(len(p.components))
    scores = map_quantiles(normal, SPREAD, p.marginals) * p.subject_scales[subject] * p.ring_scales[ring]
    slopes = p.slopes[subject, 0] * (ring - CENTRE) + p.slopes[subject, 1] * (angle - CENTRE)
    mean = p.regions[region] + p.sessions[session] + slopes
    return mean + (scores[:, None] * p.components).sum(axis=0) + p.left * rng.standard_normal(len(p.left))


def map_quantiles(values: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Maps values (n,) from quantiles (n, Q) or (Q,) to other quantiles (n, Q): piecewise linear, constant beyond."""
    source, rows = np.broadcast_to(source, target.shape), np.arange(len(values))
    i = np.clip((source <= values[:, None]).sum(axis=1) - 1, 0, source.shape[1] - 2)
    width = source[rows, i + 1] - source[rows, i]
    share = np.clip((values - source[rows, i]) / width, 0.0, 1.0)
    return target[rows, i] + share * (target[rows, i + 1] - target[rows, i])


def generate(number: int, p: Parameters) -> Reach:
    """The reach with a number, which determines the reach. Numbers go through the start regions, then the sessions."""
    rng = np.random.default_rng([STREAM, number])
    region, session = region_and_session(number, p)
    features = draw_features(rng, p, region, session)
    features[: len(p.drawn)] = map_quantiles(features[: len(p.drawn)], p.drawn, p.recorded)
    stretches, levels, steps_and_weights = np.split(features, [STRETCHES, STRETCHES + NOISES])
    marks = np.concatenate([[0.0], np.cumsum(np.exp(stretches))])
    times = np.arange(round(marks[-1] / SAMPLING) + 1) * SAMPLING
    marks *= times[-1] / marks[-1]
    shown = times + draw_lags(rng, len(times), p, p.subjects[session])
    phase = np.clip(PchipInterpolator(marks, p.phases)(np.clip(shown, 0.0, times[-1])), 0.0, 1.0)
    poses = BSpline(KNOTS, spline_weights(steps_and_weights), 3)(phase) + draw_noise(rng, phase, np.exp(levels), p)
    turned = rotation.multiply(p.reference, rotation.exp(poses[:, 3:] / (2.0 * ARM)))
    ring, angle = divmod(region, ANGLES)
    return Reach(
        name=reach_name(number),
        times=np.round(times, DECIMALS),
        positions=np.round(poses[:, :3], DECIMALS),
        quaternions=rotation.continuous(np.round(rotation.unit(turned), DECIMALS)),
        reached=round(float(marks[ARRIVED]), DECIMALS),
        subject=f"s{p.subjects[session]}",
        ring=ring,
        angle=angle,
    )


def reach_name(number: int) -> str:
    """The name of the reach with a number."""
    return f"synthetic-{number:04d}"


def region_and_session(number: int, p: Parameters) -> tuple[int, int]:
    """Start region and session of the reach with a number."""
    return number % REGIONS, number // REGIONS % len(p.sessions)


def spline_weights(features: np.ndarray) -> np.ndarray:
    """Weights (WEIGHTS, CHANNELS) from log step sizes (SIZES,) followed by the drawn weights.

    The steps between weights keep their drawn directions and take these sizes. Without the sizes, a hand at rest would
    move as much as the recorded hands do on average, although most recorded hands are still.
    """
    sizes = np.exp(features[:SIZES]).reshape(WEIGHTS - 1, 2, 1)
    drawn = features[SIZES:].reshape(WEIGHTS, 2, 3)
    steps = np.diff(drawn, axis=0)
    before = resize_steps(steps[:GRASP], sizes[:GRASP])
    after = resize_steps(steps[GRASP:], sizes[GRASP:])
    weights = [
        drawn[GRASP] - np.cumsum(before[::-1], axis=0)[::-1],
        drawn[GRASP : GRASP + 1],
        drawn[GRASP] + np.cumsum(after, axis=0),
    ]
    return np.concatenate(weights).reshape(WEIGHTS, CHANNELS)


def resize_steps(steps: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Scales steps (n, 2, 3) to sizes (n, 2, 1), and keeps their sum approximately."""
    resized = steps
    for _ in range(ROUNDS):
        resized = resized + (steps.sum(axis=0) - resized.sum(axis=0)) * sizes / sizes.sum(axis=0)
        resized = resized * (sizes / np.sqrt((resized * resized).sum(axis=-1, keepdims=True)))
    return resized


def draw_lags(rng: np.random.Generator, n: int, p: Parameters, subject: int) -> np.ndarray:
    """Draws sensor lags [s] (n,): each sample shows the pose of a moment that is later by its lag."""
    taps = p.lag_taps[subject]
    return np.interp(filter_noise(rng.standard_normal(n + len(taps) - 1), taps), SPREAD, p.lags[subject])


def draw_noise(rng: np.random.Generator, phase: np.ndarray, levels: np.ndarray, p: Parameters) -> np.ndarray:
    """Draws sensor noise [m] (n, CHANNELS) at phases (n,), for the noise levels [m] (NOISES,) of a reach."""
    normal = filter_noise(rng.standard_normal((len(phase) + len(p.noise_taps) - 1, CHANNELS)), p.noise_taps)
    standard = np.stack([np.interp(z, SPREAD, level) for z, level in zip(normal.T, p.noise, strict=True)], axis=1)
    bins = np.minimum((phase * len(p.noise_profile)).astype(int), len(p.noise_profile) - 1)
    stage = np.searchsorted(STAGES, phase, side="right")
    return standard * p.noise_profile[bins] * levels.reshape(-1, 2)[stage].repeat(3, axis=1)


def filter_noise(white: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """Noise (n, ...) from white noise (n + T - 1, ...) and a filter (T,), whose first tap is the latest."""
    n = len(white) - len(taps) + 1
    filtered = np.zeros((n, *white.shape[1:]))
    for i, tap in enumerate(taps):  # Without a BLAS library, whose order of additions differs between processors.
        filtered += tap * white[len(taps) - 1 - i :][:n]
    return filtered


class SyntheticSource(ReachSource):
    """The source `synthetic`: it draws settings on COUNT reaches, and has every reach with a name that is NAME.

    It generates each reach at its first use.
    """

    def __init__(self) -> None:
        super().__init__("synthetic", ())
        self.names = tuple(map(reach_name, range(COUNT)))

    def new_reaches(self, count: int, rng: np.random.Generator) -> list[str]:
        """Names of reaches that nobody has used."""
        return [reach_name(int(number)) for number in rng.integers(10**6, 10**12, count)]

    def reach(self, name: str) -> Reach:
        """The reach of that name. Raises UnknownReach."""
        if name not in self._reaches:
            self._reaches[name] = generate(self._number(name), shipped_parameters())
        return self._reaches[name]

    def stratum(self, reach: str) -> Stratum:
        """Virtual subject and start region of the reach of that name. Raises UnknownReach."""
        region, session = region_and_session(self._number(reach), shipped_parameters())
        return Stratum(f"s{shipped_parameters().subjects[session]}", *divmod(region, ANGLES))

    def _number(self, name: str) -> int:
        if not (isinstance(name, str) and (known := NAME.fullmatch(name))):
            raise UnknownReach(name, self.name, self.names)
        return int(known[1])


def open_synthetic() -> SyntheticSource:
    """Opens the source `synthetic`."""
    return SyntheticSource()
