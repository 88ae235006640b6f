"""Fits the synthetic model to recorded reaches.

The session of a reach is its name up to the last underscore: `01_fl` for `01_fl_16`. Reaches without an underscore in
their names have one session for each subject.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.special import ndtr, ndtri

from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.synthetic import generator
from dextron_bench.reaches.synthetic.encoding import Encoded, encode, grasping_orientation, log_stretches
from dextron_bench.reaches.synthetic.parameters import (
    ANGLES,
    CENTRE,
    CHANNELS,
    NOISES,
    REGIONS,
    SIZES,
    SPREAD,
    STAGES,
    STRETCHES,
    WEIGHTS,
    Parameters,
    rounded,
)

COMPONENTS = 110
UNITS = (0.05, 0.3, 0.3, 0.005)  # Units of stretches, noise levels and step sizes [log] and of weights [m].
PRIOR = 10.0  # Weight, in reaches, of the prior scale of a subject or ring.
SCALE_PASSES = 3
FAST = 0.45  # [m/s] speed from which a sample shows its lag.
SMOOTH = 7  # Samples over which that speed is averaged.
LAG_ORDER, NOISE_ORDER = 10, 6  # Orders of the autoregressions.
TAPS = 41
BINS = 20  # Bins of phase in the profile of noise.
TAIL = 0.003  # Share at either end in which all lags have one normal score.
DRAWS = 6  # Draws for each session and region, whose features are compared with the recorded ones.


@dataclass(frozen=True, slots=True)
class Groups:
    """Session, subject, ring and angle of n reaches, each of shape (n,), and the subject of each session (S,)."""

    session: np.ndarray
    subject: np.ndarray
    ring: np.ndarray
    angle: np.ndarray
    subjects: np.ndarray

    @classmethod
    def from_reaches(cls, reaches: Sequence[Reach]) -> Groups:
        """The groups of reaches. Sessions and subjects are numbered in the order of their names."""
        session_names = [reach.name.rpartition("_")[0] or reach.subject for reach in reaches]
        subject_names = {name: reach.subject for name, reach in zip(session_names, reaches, strict=True)}
        sessions, names = sorted(subject_names), sorted(set(subject_names.values()))
        subjects = np.array([names.index(subject_names[session]) for session in sessions])
        session = np.array([sessions.index(name) for name in session_names])
        ring, angle = np.array([r.ring for r in reaches]), np.array([r.angle for r in reaches])
        return cls(session, subjects[session], ring, angle, subjects)


def fit(reaches: Sequence[Reach], seed: int) -> Parameters:
    """The parameters of the model for recorded reaches, which must include every start region."""
    groups = Groups.from_reaches(reaches)
    reference = grasping_orientation(reaches)
    stretches = np.array([log_stretches(reach) for reach in reaches])
    typical = np.exp(stretches.mean(axis=0))
    phases = np.concatenate([[0.0], np.cumsum(typical)]) / typical.sum()
    encoded = [encode(r, reference, s, phases) for r, s in zip(reaches, stretches, strict=True)]
    features = np.array([reach.features() for reach in encoded])
    features = np.where(np.isnan(features), np.nanmedian(features, axis=0), features)
    linear = linear_part(features, groups)
    sensor = lag_part(reaches, encoded, groups) | noise_part(encoded, features)
    empty = np.zeros((0, len(SPREAD)))
    unmapped = rounded(Parameters(reference, phases, **linear, **sensor, drawn=empty, recorded=empty))
    return rounded(replace(unmapped, **feature_quantiles(unmapped, features, np.random.default_rng(seed))))


def quantiles(values: np.ndarray) -> np.ndarray:
    """Quantiles (n, Q) at SPREAD of the columns of values (m, n)."""
    return np.quantile(values, ndtr(SPREAD), axis=0).T


def linear_part(features: np.ndarray, groups: Groups) -> dict[str, np.ndarray]:
    """Means, effects, components and scales of features (n, F)."""
    subject_count, session_count = groups.subjects.max() + 1, len(groups.subjects)
    subject = np.eye(subject_count)[groups.subject]
    design = [np.eye(REGIONS)[ANGLES * groups.ring + groups.angle], np.eye(session_count)[groups.session]]
    design += [subject * (place - CENTRE)[:, None] for place in (groups.ring, groups.angle)]
    effects = np.linalg.lstsq(np.concatenate(design, axis=1), features, rcond=None)[0]
    residuals = features - np.concatenate(design, axis=1) @ effects
    units = np.repeat(UNITS, (STRETCHES, NOISES, SIZES, WEIGHTS * CHANNELS))
    u, s, v = np.linalg.svd(residuals / units, full_matrices=False)
    scores, components = u[:, :COMPONENTS] * s[:COMPONENTS], v[:COMPONENTS] * units
    regions, sessions, slopes = np.split(effects, [REGIONS, REGIONS + session_count])
    return {
        "regions": regions,
        "sessions": sessions,
        "subjects": groups.subjects,
        "slopes": slopes.reshape(2, subject_count, -1).swapaxes(0, 1),
        "components": components,
        "left": (residuals - scores @ components).std(axis=0),
    } | scale_part(scores, groups)


def scale_part(scores: np.ndarray, groups: Groups) -> dict[str, np.ndarray]:
    """Scales of scores (n, C) by subject and by ring, and quantiles of the scores divided by their scales."""
    by_subject = np.ones((groups.subjects.max() + 1, scores.shape[1]))
    by_ring = np.ones((4, scores.shape[1]))
    for _ in range(SCALE_PASSES):
        scaled = scores / by_ring[groups.ring]
        for k in range(len(by_subject)):
            by_subject[k] = shrunk_scale(scaled[groups.subject == k], scaled.var(axis=0))
        scaled = scores / by_subject[groups.subject]
        for k in range(len(by_ring)):
            by_ring[k] = shrunk_scale(scaled[groups.ring == k], np.ones(scores.shape[1]))
    standard = scores / by_subject[groups.subject] / by_ring[groups.ring]
    marginals = quantiles(standard / standard.std(axis=0))
    return {"marginals": marginals, "subject_scales": by_subject, "ring_scales": by_ring}


def shrunk_scale(scores: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Standard deviation about zero (C,) of scores (m, C), shrunk toward the root of a prior variance (C,)."""
    return np.sqrt(((scores**2).sum(axis=0) + PRIOR * prior) / (len(scores) + PRIOR))


def lag_part(reaches: Sequence[Reach], encoded: Sequence[Encoded], groups: Groups) -> dict[str, np.ndarray]:
    """Quantiles of lags, and the filter of successive lags, for each subject."""
    pairs = zip(reaches, encoded, strict=True)
    measured = [np.where(speed(reach) > FAST, encoding.lags, np.nan) for reach, encoding in pairs]
    taps, lag_quantiles = [], []
    for k in range(groups.subjects.max() + 1):
        of_subject = [lags for lags, subject in zip(measured, groups.subject, strict=True) if subject == k]
        pool = np.sort(np.concatenate(of_subject))
        pool = pool[~np.isnan(pool)]
        lag_quantiles.append(np.quantile(pool, ndtr(SPREAD)))
        ranks = [np.clip(np.searchsorted(pool, lags) / len(pool), TAIL, 1.0 - TAIL) for lags in of_subject]
        scores = [np.where(np.isnan(lags), np.nan, ndtri(rank)) for lags, rank in zip(of_subject, ranks, strict=True)]
        products = [np.nanmean(np.concatenate([z[: len(z) - j] * z[j:] for z in scores])) for j in range(LAG_ORDER + 1)]
        taps.append(impulse_response(np.array(products) / products[0]))
    return {"lag_taps": np.array(taps), "lags": np.array(lag_quantiles)}


def speed(reach: Reach) -> np.ndarray:
    """Smoothed speed of the carrier [m/s] at each sample, shape (n,)."""
    raw = np.sqrt((np.gradient(reach.positions, reach.times, axis=0) ** 2).sum(axis=1))
    return np.convolve(raw, np.full(SMOOTH, 1.0 / SMOOTH), "same")


def impulse_response(correlations: np.ndarray) -> np.ndarray:
    """Filter (TAPS,) from white noise to unit noise with autocorrelations (p + 1,), by Yule and Walker."""
    coefficients = solve_toeplitz(correlations[:-1], correlations[1:])
    taps = np.zeros(TAPS)
    taps[0] = np.sqrt(1.0 - (coefficients * correlations[1:]).sum())
    for i in range(1, TAPS):
        order = min(i, len(coefficients))
        taps[i] = (coefficients[:order] * taps[i - 1 :: -1][:order]).sum()
    return taps


def noise_part(encoded: Sequence[Encoded], features: np.ndarray) -> dict[str, np.ndarray]:
    """Quantiles of noise, its profile over phase, and its filter; features (n, F) hold the levels of each reach."""
    scaled, bins = [], []
    for encoding, row in zip(encoded, features, strict=True):
        level = np.exp(row[STRETCHES : STRETCHES + NOISES]).reshape(-1, 2).repeat(3, axis=1)
        scaled.append(encoding.noise / level[np.searchsorted(STAGES, encoding.phase, side="right")])
        bins.append(np.minimum((encoding.phase * BINS).astype(int), BINS - 1))
    pool, pool_bins = np.concatenate(scaled), np.concatenate(bins)
    profile = np.array([pool[pool_bins == k].std(axis=0) for k in range(BINS)])
    unit = [(e.noise - e.noise.mean(axis=0)) / np.sqrt((e.noise**2).mean(axis=0)) for e in encoded]
    correlations = [np.mean([(z[:-j] * z[j:]).mean() for z in unit]) for j in range(1, NOISE_ORDER + 1)]
    taps = impulse_response(np.array([1.0, *correlations]))
    return {"noise_taps": taps, "noise_profile": profile, "noise": quantiles(pool / profile[pool_bins])}


def feature_quantiles(p: Parameters, features: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Quantiles of all features except the weights, as the model draws them, and in recorded features (n, F)."""
    count = STRETCHES + NOISES + SIZES
    plan = [(region, session) for session in range(len(p.sessions)) for region in range(REGIONS)] * DRAWS
    drawn = np.array([generator.draw_features(rng, p, *cell)[:count] for cell in plan])
    return {"drawn": quantiles(drawn), "recorded": quantiles(features[:, :count])}
