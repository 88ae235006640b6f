"""Features of the two-sample test: paths, speed profiles, orientations and durations of reaches.

Poses are read from the smooth curve through the samples of a reach, as the simulator reads them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
from scipy.spatial.distance import cdist
from scipy.stats import rankdata

from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.synthetic.parameters import ANGLES

GROUPS = ("durations", "paths", "orientations", "smooth speeds", "raw speeds")
BEFORE, AFTER = 14, 7  # Poses before and after the hand arrives.
GRID = 101  # Poses at equal intervals of time, between which speed is measured.
WINDOW = 2  # Intervals that are averaged into one value of the profile.
SMOOTH = np.hanning(11)[1:-1] / np.hanning(11).sum()  # About 70 ms wide: keeps arm motion, removes sensor errors.
RAW = np.ones(1)
FLOOR = 1e-3  # [m/s] and [rad/s] added to speeds before a logarithm is taken.
HORIZONTAL = np.array([1.0, 1.0, 0.0])
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def features(reaches: Sequence[Reach]) -> dict[str, np.ndarray]:
    """Features of n reaches: one array (n, k) for each of GROUPS."""
    reference = rotation.mean(np.array([reach.quaternions[0] for reach in reaches]))
    rows = [
        (durations(r), path(r), orientations(r, reference), speed_profile(r, SMOOTH), speed_profile(r, RAW))
        for r in reaches
    ]
    return {group: np.array([row[i] for row in rows]) for i, group in enumerate(GROUPS)}


def strata(reaches: Sequence[Reach]) -> Iterator[tuple[str, np.ndarray]]:
    """Yields the name of each stratum that is not empty, and which reaches (n,) it contains."""
    ring, angle = np.array([r.ring for r in reaches]), np.array([r.angle for r in reaches])
    yield "all", np.ones(len(reaches), bool)
    for name, numbers in (("ring", ring), ("angle", angle)):
        for number in np.unique(numbers):
            yield f"{name} {number}", numbers == number
    for region in np.unique(ANGLES * ring + angle):
        yield f"{region // ANGLES}-{region % ANGLES}", ANGLES * ring + angle == region


def durations(reach: Reach) -> np.ndarray:
    """Log duration [log s], share of the duration before the hand arrives, and time after that [s]; shape (3,)."""
    return np.array([np.log(reach.duration), reach.reached / reach.duration, reach.duration - reach.reached])


def moments(reach: Reach) -> np.ndarray:
    """Times [s] (BEFORE + AFTER,), evenly spaced before the hand arrives, and evenly spaced after it."""
    before = np.linspace(0.0, reach.reached, BEFORE)
    return np.concatenate([before, np.linspace(reach.reached, reach.duration, AFTER + 1)[1:]])


def path(reach: Reach) -> np.ndarray:
    """Positions [m] at `moments`, flattened; horizontally relative to the position at which the hand arrives."""
    positions, _ = reach.curve(moments(reach))
    return (positions - positions[BEFORE - 1] * HORIZONTAL).ravel()


def orientations(reach: Reach, reference: np.ndarray) -> np.ndarray:
    """Rotation vectors [rad] relative to a reference (4,) at `moments`, flattened."""
    quaternions = reach.curve(moments(reach))[1]
    signs = np.where((quaternions * reference).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    return 2.0 * rotation.log(rotation.multiply(rotation.conjugate(reference), signs * quaternions)).ravel()


def speeds(reach: Reach, window: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Speeds [m/s] and angular speeds [rad/s] over GRID - 1 equal intervals of time, and the interval [s].

    Velocities are averaged over a window of weights (w,), whose sum is 1, before their norm is taken.
    """
    step = reach.duration / (GRID - 1)
    positions, quaternions = reach.curve(np.linspace(0.0, reach.duration, GRID))
    turned = 2.0 * rotation.log(rotation.multiply(rotation.conjugate(quaternions[:-1]), quaternions[1:]))
    velocities = np.concatenate([np.diff(positions, axis=0), turned], axis=1) / step
    coverage = np.convolve(np.ones(GRID - 1), window, "same")
    averaged = np.stack([np.convolve(v, window, "same") / coverage for v in velocities.T], axis=1)
    linear, angular = (np.sqrt((part**2).sum(axis=1)) for part in (averaged[:, :3], averaged[:, 3:]))
    return linear, angular, step


def speed_profile(reach: Reach, window: np.ndarray) -> np.ndarray:
    """Log speeds and log angular speeds over time, and measures of their peaks and roughness; flattened."""
    linear, angular, step = speeds(reach, window)
    profiles = [np.log(v.reshape(-1, WINDOW).mean(axis=1) + FLOOR) for v in (linear, angular)]
    rough = [np.log((np.diff(v) ** 2).mean()) for v in (linear, angular)]
    peaks = [np.log(linear.max()), linear.argmax() / (GRID - 1), np.log(linear.sum() * step), np.log(angular.max())]
    return np.concatenate([*profiles, rough, peaks])


def measures(reach: Reach) -> dict[str, float]:
    """Measures of a reach by name. The curvature is the length of the path to the bottle over the straight distance."""
    linear, angular, step = speeds(reach, SMOOTH)
    arrival = int(reach.reached / step)
    positions, _ = reach.curve(np.array([0.0, reach.reached, reach.duration]))
    straight = np.sqrt(((positions[1] - positions[0]) ** 2).sum())
    return {
        "duration [s]": reach.duration,
        "arrival [s]": reach.reached,
        "peak speed [m/s]": linear.max(),
        "time to peak speed, to arrival [s]": step * (linear[: max(arrival, 1)].argmax() + 0.5),
        "path length [m]": linear.sum() * step,
        "curvature": linear[:arrival].sum() * step / straight,
        "mean turning speed [rad/s]": angular.mean(),
        "grasp height [m]": positions[1, 2],
        "end height [m]": positions[2, 2],
    }


def summaries(real: Sequence[Reach], synthetic: Sequence[Reach]) -> pd.DataFrame:
    """Quantiles of `measures` and of the end spread: one row for each measure and source.

    The end position of a reach is measured from the position at which the hand arrives. The end spread is its distance
    [m] from the mean end position of the source.
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


def nearest_recorded(real: Sequence[Reach], synthetic: Sequence[Reach]) -> pd.DataFrame:
    """Distance [m] of each reach to the nearest other recorded one: minimum and QUANTILES, one row for each source.

    The distance of two reaches is the root mean square over their `path`.
    """
    recorded, generated = (np.array([path(reach) for reach in reaches]) for reaches in (real, synthetic))
    between = cdist(recorded, recorded)
    np.fill_diagonal(between, np.inf)
    rows = []
    for source, distances in (("real", between), ("synthetic", cdist(generated, recorded))):
        least = pd.Series(distances.min(axis=1) / np.sqrt(BEFORE + AFTER))
        rows.append({"source": source, "least": least.min(), **least.quantile(list(QUANTILES)).to_dict()})
    return pd.DataFrame(rows)


def single_feature_aucs(real: Sequence[Reach], synthetic: Sequence[Reach]) -> pd.DataFrame:
    """Lowest and highest AUC of a single feature as the score, one row for each of GROUPS."""
    rows = []
    for group, values in features([*real, *synthetic]).items():
        wins = rankdata(values, axis=0)[len(real) :].mean(axis=0) - (len(synthetic) + 1) / 2
        rows.append({"group": group, "low": wins.min() / len(real), "high": wins.max() / len(real)})
    return pd.DataFrame(rows)
