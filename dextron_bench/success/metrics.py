"""How good predicted chances of success are, against the predictor that always says the base rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

BINS = 10  # Of the calibration curve, equally wide.


@dataclass(frozen=True, slots=True)
class Metrics:
    """Scores of predictions of N outcomes; those of the base rate, the mean outcome itself, stand beside them.

    `auc` is the chance that a success was given a higher one than a failure, NaN where there is one kind alone.
    """

    rows: int
    base_rate: float
    accuracy: float
    base_accuracy: float
    brier: float
    base_brier: float
    calibration_error: float
    auc: float


def evaluate(chances: np.ndarray, outcomes: np.ndarray) -> Metrics:
    """The judgement of chances (N,) in [0, 1] against outcomes (N,), 1 for success."""
    base = float(outcomes.mean())
    means, shares, counts = calibration(chances, outcomes)
    apart = np.abs(means - shares)[counts > 0]
    return Metrics(
        rows=len(outcomes),
        base_rate=base,
        accuracy=float(((chances > 0.5) == (outcomes == 1)).mean()),
        base_accuracy=max(base, 1.0 - base),
        brier=float(((chances - outcomes) ** 2).mean()),
        base_brier=base * (1.0 - base),
        calibration_error=float((apart * counts[counts > 0]).sum() / len(outcomes)),
        auc=auc(chances, outcomes),
    )


def calibration(chances: np.ndarray, outcomes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean chance, share of successes (NaN where empty) and number of predictions in each of BINS bins."""
    of = np.minimum((chances * BINS).astype(int), BINS - 1)
    counts = np.bincount(of, minlength=BINS)
    with np.errstate(invalid="ignore"):
        means, shares = (np.bincount(of, values, BINS) / counts for values in (chances, outcomes))
    return means, shares, counts


def auc(chances: np.ndarray, outcomes: np.ndarray) -> float:
    """Area under the ROC curve, ties counted half; NaN where all outcomes are equal."""
    good = outcomes == 1
    wins, losses = int(good.sum()), int((~good).sum())
    if not wins or not losses:
        return float("nan")
    return float((rankdata(chances)[good].sum() - wins * (wins + 1) / 2) / (wins * losses))
