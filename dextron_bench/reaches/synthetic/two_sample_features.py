"""What a two-sample test looks at: paths, speed profiles, orientations and durations of reaches.

Reaches are read as the simulator reads them, through the smooth curve that interpolates their samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
from scipy.spatial.distance import cdist
from scipy.stats import rankdata

from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.synthetic.generator import ANGLES

GROUPS = ("durations", "paths", "orientations", "smooth speeds", "raw speeds")
BEFORE, AFTER = 14, 7  # Poses looked at before and after the hand arrives.
GRID = 101  # Stretches of equal time over which speed is measured.
WINDOW = 2  # Of them averaged into one value of the profile.
SMOOTH = np.hanning(11)[1:-1] / np.hanning(11).sum()  # Over about 70 ms: what an arm does, without the sensor.
RAW = np.ones(1)
FLOOR = 1e-3  # [m/s], [rad/s] added to speeds before a logarithm is taken.
LEVEL = np.array([1.0, 1.0, 0.0])
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def features(reaches: Sequence[Reach]) -> dict[str, np.ndarray]:
    """One array (n, k) for each of GROUPS."""
    reference = rotation.mean(np.array([reach.quaternions[0] for reach in reaches]))
    rows = [
        (durations(r), path(r), orientations(r, reference), speed_profile(r, SMOOTH), speed_profile(r, RAW))
        for r in reaches
    ]
    return {group: np.array([row[i] for row in rows]) for i, group in enumerate(GROUPS)}


def strata(reaches: Sequence[Reach]) -> Iterator[tuple[str, np.ndarray]]:
    """Names of strata, and which reaches (n,) are in them; only those that have any."""
    ring, angle = np.array([r.ring for r in reaches]), np.array([r.angle for r in reaches])
    yield "all", np.ones(len(reaches), bool)
    for name, places in (("ring", ring), ("angle", angle)):
        for place in np.unique(places):
            yield f"{name} {place}", places == place
    for region in np.unique(ANGLES * ring + angle):
        yield f"{region // ANGLES}-{region % ANGLES}", ANGLES * ring + angle == region


def durations(reach: Reach) -> np.ndarray:
    """Log duration [log s], share of it until the hand arrives, and time after that [s]; shape (3,)."""
    return np.array([np.log(reach.duration), reach.reached / reach.duration, reach.duration - reach.reached])


def moments(reach: Reach) -> np.ndarray:
    """Times [s] (BEFORE + AFTER,), even before the hand arrives and even after it."""
    before = np.linspace(0.0, reach.reached, BEFORE)
    return np.concatenate([before, np.linspace(reach.reached, reach.duration, AFTER + 1)[1:]])


def path(reach: Reach) -> np.ndarray:
    """Positions [m] at `moments`, level ones from where the hand arrives, flattened."""
    positions, _ = reach.curve(moments(reach))
    return (positions - positions[BEFORE - 1] * LEVEL).ravel()


def orientations(reach: Reach, reference: np.ndarray) -> np.ndarray:
    """Rotation vectors [rad] from a reference at `moments`, flattened."""
    quaternions = reach.curve(moments(reach))[1]
    signs = np.where((quaternions * reference).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    return 2.0 * rotation.log(rotation.multiply(rotation.conjugate(reference), signs * quaternions)).ravel()


def speeds(reach: Reach, window: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Speed [m/s] and turning speed [rad/s] over GRID - 1 equal stretches of time, and a stretch [s].

    Velocities are averaged with a window of weights (w,) that sum to 1 before their length is taken.
    """
    step = reach.duration / (GRID - 1)
    positions, quaternions = reach.curve(np.linspace(0.0, reach.duration, GRID))
    turned = 2.0 * rotation.log(rotation.multiply(rotation.conjugate(quaternions[:-1]), quaternions[1:]))
    velocities = np.concatenate([np.diff(positions, axis=0), turned], axis=1) / step
    whole = np.convolve(np.ones(GRID - 1), window, "same")
    averaged = np.stack([np.convolve(v, window, "same") / whole for v in velocities.T], axis=1)
    moving, turning = (np.sqrt((part**2).sum(axis=1)) for part in (averaged[:, :3], averaged[:, 3:]))
    return moving, turning, step


def speed_profile(reach: Reach, window: np.ndarray) -> np.ndarray:
    """Log speeds and log turning speeds over time, and measures of their peaks and roughness."""
    moving, turning, step = speeds(reach, window)
    profiles = [np.log(v.reshape(-1, WINDOW).mean(axis=1) + FLOOR) for v in (moving, turning)]
    rough = [np.log((np.diff(v) ** 2).mean()) for v in (moving, turning)]
    measures = [np.log(moving.max()), moving.argmax() / (GRID - 1), np.log(moving.sum() * step), np.log(turning.max())]
    return np.concatenate([*profiles, rough, measures])


def measures(reach: Reach) -> dict[str, float]:
    """Numbers that describe a reach; curvature is the way to the bottle over the straight line there."""
    moving, turning, step = speeds(reach, SMOOTH)
    arrived = int(reach.reached / step)
    positions, _ = reach.curve(np.array([0.0, reach.reached, reach.duration]))
    straight = np.sqrt(((positions[1] - positions[0]) ** 2).sum())
    return {
        "duration [s]": reach.duration,
        "arrival [s]": reach.reached,
        "peak speed [m/s]": moving.max(),
        "time to peak speed, to arrival [s]": step * (moving[: max(arrived, 1)].argmax() + 0.5),
        "path length [m]": moving.sum() * step,
        "curvature": moving[:arrived].sum() * step / straight,
        "mean turning speed [rad/s]": turning.mean(),
        "grasp height [m]": positions[1, 2],
        "end height [m]": positions[2, 2],
    }


def summaries(real: Sequence[Reach], synthetic: Sequence[Reach]) -> pd.DataFrame:
    """Quantiles of `measures` and of end spread, one row a measure and source.

    End spread is the distance [m] from where a hand ends, seen from where it arrived, to where hands end on average.
    """
    rows = []
    for source, reaches in (("real", real), ("synthetic", synthetic)):
        table = pd.DataFrame([measures(reach) for reach in reaches])
        ends = np.array([path(reach).reshape(-1, 3)[-1] for reach in reaches])
        table["end spread [m]"] = np.sqrt(((ends - ends.mean(axis=0)) ** 2).sum(axis=1))
        rows += [
            {"measure": name, "source": source, **table[name].quantile(list(QUANTILES)).to_dict()}
            for name in table.columns
        ]
    return pd.DataFrame(rows).sort_values(["measure", "source"], kind="stable", ignore_index=True)


def nearest(real: Sequence[Reach], synthetic: Sequence[Reach]) -> pd.DataFrame:
    """Least distance [m] and its QUANTILES, one row a source, from each reach to the nearest (other) recorded one.

    The distance of two reaches is the root mean square over their `path`.
    """
    recorded, made = (np.array([path(reach) for reach in reaches]) for reaches in (real, synthetic))
    between = cdist(recorded, recorded)
    np.fill_diagonal(between, np.inf)
    rows = []
    for source, distances in (("real", between), ("synthetic", cdist(made, recorded))):
        least = pd.Series(distances.min(axis=1) / np.sqrt(BEFORE + AFTER))
        rows.append({"source": source, "least": least.min(), **least.quantile(list(QUANTILES)).to_dict()})
    return pd.DataFrame(rows)


def alone(real: Sequence[Reach], synthetic: Sequence[Reach]) -> pd.DataFrame:
    """Lowest and highest AUC of a single feature taken as the score, one row for each of GROUPS."""
    rows = []
    for group, values in features([*real, *synthetic]).items():
        wins = rankdata(values, axis=0)[len(real) :].mean(axis=0) - (len(synthetic) + 1) / 2
        rows.append({"group": group, "low": wins.min() / len(real), "high": wins.max() / len(real)})
    return pd.DataFrame(rows)
