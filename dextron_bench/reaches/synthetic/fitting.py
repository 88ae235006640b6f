"""Fits the synthetic model to recorded reaches.

It lives beside the generator because the two share the model's terms, and neither knows of anything but
reaches. Sessions are told by reach names: all before the last underscore, as in `01_fl_16`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.special import ndtr, ndtri

from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.synthetic import generator
from dextron_bench.reaches.synthetic.encoding import Encoded, encode, grasping_orientation, log_stretches
from dextron_bench.reaches.synthetic.generator import (
    CHANNELS,
    NOISES,
    REGIONS,
    SIZES,
    STAGES,
    STRETCHES,
    WEIGHTS,
    Parameters,
)

COMPONENTS = 110
UNITS = (0.05, 0.3, 0.3, 0.005)  # What counts as one in stretches, noise levels, step sizes [log], weights [m].
PRIOR = 10.0  # Reaches that a subject's or ring's scale is worth before any is seen.
SCALE_PASSES = 3
FAST = 0.45  # [m/s] from which a lag can be read off a sample.
SMOOTH = 7  # Samples over which that speed is averaged.
LAG_ORDER, NOISE_ORDER = 10, 6  # Of the autoregressions.
TAPS = 41
BINS = 20  # Of phase, for the profile of noise.
TAIL = 0.003  # Share at either end beyond which a lag's normal score is not told apart.
REHEARSALS = 6  # Draws for each session and region, from which features as drawn are compared to those recorded.
HALF = ("sessions", "slopes", "components")  # Stored in half precision: effects need three digits.


@dataclass(frozen=True, slots=True)
class Groups:
    """Which session, subject, ring and angle each of n reaches belongs to, each (n,); and sessions' subjects."""

    session: np.ndarray
    subject: np.ndarray
    ring: np.ndarray
    angle: np.ndarray
    subjects: np.ndarray

    @classmethod
    def of(cls, reaches: Sequence[Reach]) -> Groups:
        """The groups of reaches, sessions and subjects in the order of their names."""
        owners = {r.name.rpartition("_")[0]: r.subject for r in reaches}
        sessions, people = sorted(owners), sorted(set(owners.values()))
        subjects = np.array([people.index(owners[session]) for session in sessions])
        session = np.array([sessions.index(r.name.rpartition("_")[0]) for r in reaches])
        ring, angle = np.array([r.ring for r in reaches]), np.array([r.angle for r in reaches])
        return cls(session, subjects[session], ring, angle, subjects)


def fit(reaches: Sequence[Reach], seed: int) -> Parameters:
    """The model's parameters for recorded reaches, with every start region among them."""
    groups = Groups.of(reaches)
    reference = grasping_orientation(reaches)
    stretches = np.array([log_stretches(reach) for reach in reaches])
    typical = np.exp(stretches.mean(axis=0))
    phases = np.concatenate([[0.0], np.cumsum(typical)]) / typical.sum()
    encoded = [encode(r, reference, s, phases) for r, s in zip(reaches, stretches, strict=True)]
    features = np.array([each.features() for each in encoded])
    features = np.where(np.isnan(features), np.nanmedian(features, axis=0), features)
    linear = linear_part(features, groups)
    sensor = lag_part(reaches, encoded, groups) | noise_part(encoded, features)
    nothing = np.zeros((0, len(generator.SPREAD)))
    rough = stored(Parameters(reference, phases, **linear, **sensor, drawn=nothing, recorded=nothing))
    return stored(replace(rough, **rehearsed(rough, features, np.random.default_rng(seed))))


def levels(values: np.ndarray) -> np.ndarray:
    """Quantiles (n, Q) at SPREAD of the columns of values (m, n)."""
    return np.quantile(values, ndtr(generator.SPREAD), axis=0).T


def linear_part(features: np.ndarray, groups: Groups) -> dict[str, np.ndarray]:
    """Means, effects, components and scales of features (n, F)."""
    people, meetings = groups.subjects.max() + 1, len(groups.subjects)
    person = np.eye(people)[groups.subject]
    design = [np.eye(REGIONS)[generator.ANGLES * groups.ring + groups.angle], np.eye(meetings)[groups.session]]
    design += [person * (place - generator.CENTRE)[:, None] for place in (groups.ring, groups.angle)]
    effects = np.linalg.lstsq(np.concatenate(design, axis=1), features, rcond=None)[0]
    left = features - np.concatenate(design, axis=1) @ effects
    units = np.repeat(UNITS, (STRETCHES, NOISES, SIZES, WEIGHTS * CHANNELS))
    u, s, v = np.linalg.svd(left / units, full_matrices=False)
    scores, components = u[:, :COMPONENTS] * s[:COMPONENTS], v[:COMPONENTS] * units
    regions, sessions, slopes = np.split(effects, [REGIONS, REGIONS + meetings])
    return {
        "regions": regions,
        "sessions": sessions,
        "subjects": groups.subjects,
        "slopes": slopes.reshape(2, people, -1).swapaxes(0, 1),
        "components": components,
        "left": (left - scores @ components).std(axis=0),
    } | scale_part(scores, groups)


def scale_part(scores: np.ndarray, groups: Groups) -> dict[str, np.ndarray]:
    """How scores (n, C) spread by subject and by ring, and their quantiles once that is divided out."""
    by_subject = np.ones((groups.subjects.max() + 1, scores.shape[1]))
    by_ring = np.ones((4, scores.shape[1]))
    for _ in range(SCALE_PASSES):
        even = scores / by_ring[groups.ring]
        for k in range(len(by_subject)):
            by_subject[k] = shrunk_scale(even[groups.subject == k], even.var(axis=0))
        even = scores / by_subject[groups.subject]
        for k in range(len(by_ring)):
            by_ring[k] = shrunk_scale(even[groups.ring == k], np.ones(scores.shape[1]))
    standard = scores / by_subject[groups.subject] / by_ring[groups.ring]
    marginals = levels(standard / standard.std(axis=0))
    return {"marginals": marginals, "subject_scales": by_subject, "ring_scales": by_ring}


def shrunk_scale(scores: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Standard deviation about zero (C,) of scores (m, C), drawn toward a prior variance (C,)."""
    return np.sqrt(((scores**2).sum(axis=0) + PRIOR * prior) / (len(scores) + PRIOR))


def lag_part(reaches: Sequence[Reach], encoded: Sequence[Encoded], groups: Groups) -> dict[str, np.ndarray]:
    """Quantiles and succession of lags, for each subject."""
    known = [np.where(speed(reach) > FAST, each.lags, np.nan) for reach, each in zip(reaches, encoded, strict=True)]
    taps, quantiles = [], []
    for k in range(groups.subjects.max() + 1):
        own = [lags for lags, subject in zip(known, groups.subject, strict=True) if subject == k]
        pool = np.sort(np.concatenate(own))
        pool = pool[~np.isnan(pool)]
        quantiles.append(np.quantile(pool, ndtr(generator.SPREAD)))
        ranks = [np.clip(np.searchsorted(pool, lags) / len(pool), TAIL, 1.0 - TAIL) for lags in own]
        scores = [np.where(np.isnan(lags), np.nan, ndtri(rank)) for lags, rank in zip(own, ranks, strict=True)]
        products = [np.nanmean(np.concatenate([z[: len(z) - j] * z[j:] for z in scores])) for j in range(LAG_ORDER + 1)]
        taps.append(impulse_response(np.array(products) / products[0]))
    return {"lag_taps": np.array(taps), "lags": np.array(quantiles)}


def speed(reach: Reach) -> np.ndarray:
    """Smoothed speed of the carrier [m/s] at each sample, shape (n,)."""
    raw = np.sqrt((np.gradient(reach.positions, reach.times, axis=0) ** 2).sum(axis=1))
    return np.convolve(raw, np.full(SMOOTH, 1.0 / SMOOTH), "same")


def impulse_response(correlations: np.ndarray) -> np.ndarray:
    """Taps (TAPS,) that turn white noise into unit noise with autocorrelations (p + 1,), by Yule and Walker."""
    echo = solve_toeplitz(correlations[:-1], correlations[1:])
    taps = np.zeros(TAPS)
    taps[0] = np.sqrt(1.0 - (echo * correlations[1:]).sum())
    for i in range(1, TAPS):
        reach = min(i, len(echo))
        taps[i] = (echo[:reach] * taps[i - 1 :: -1][:reach]).sum()
    return taps


def noise_part(encoded: Sequence[Encoded], features: np.ndarray) -> dict[str, np.ndarray]:
    """Quantiles, profile over phase and succession of noise; features (n, F) hold each reach's levels."""
    even, bins = [], []
    for each, row in zip(encoded, features, strict=True):
        level = np.exp(row[STRETCHES : STRETCHES + NOISES]).reshape(-1, 2).repeat(3, axis=1)
        even.append(each.noise / level[np.searchsorted(STAGES, each.phase, side="right")])
        bins.append(np.minimum((each.phase * BINS).astype(int), BINS - 1))
    pool, at = np.concatenate(even), np.concatenate(bins)
    profile = np.array([pool[at == k].std(axis=0) for k in range(BINS)])
    unit = [(e.noise - e.noise.mean(axis=0)) / np.sqrt((e.noise**2).mean(axis=0)) for e in encoded]
    later = [np.mean([(z[:-j] * z[j:]).mean() for z in unit]) for j in range(1, NOISE_ORDER + 1)]
    taps = impulse_response(np.array([1.0, *later]))
    return {"noise_taps": taps, "noise_profile": profile, "noise": levels(pool / profile[at])}


def rehearsed(p: Parameters, features: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Quantiles of all features but the weights, as the components draw them and as recorded (n, F)."""
    count = STRETCHES + NOISES + SIZES
    plan = [(region, session) for session in range(len(p.sessions)) for region in range(REGIONS)] * REHEARSALS
    drawn = np.array([generator.draw_features(rng, p, *each)[:count] for each in plan])
    return {"drawn": levels(drawn), "recorded": levels(features[:, :count])}


def stored(p: Parameters) -> Parameters:
    """The parameters as they are once saved and loaded: in half or single precision."""
    arrays = {field.name: getattr(p, field.name) for field in fields(p)}
    kept = {k: a.astype(precision(k, a)) for k, a in arrays.items()}
    return Parameters(**{k: a.astype(float) if a.dtype.kind == "f" else a for k, a in kept.items()})


def precision(name: str, array: np.ndarray) -> np.dtype:
    """How a parameter is stored."""
    if array.dtype.kind == "i":
        return np.dtype(np.int16)
    return np.dtype(np.float16 if name in HALF else np.float32)


def save(p: Parameters, file: Path) -> None:
    """Writes parameters to a .npz file, without pickles and without the time of day."""
    arrays = {field.name: getattr(p, field.name) for field in fields(p)}
    np.savez_compressed(file, allow_pickle=False, **{k: a.astype(precision(k, a)) for k, a in arrays.items()})
