"""Scores of predicted chances of success, beside the scores of a predictor that always predicts the base rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

BINS = 10  # Intervals of the calibration curve, of equal width.


@dataclass(frozen=True, slots=True)
class Metrics:
    """Scores of predictions of N outcomes.

    Fields that start with `base_` hold the scores of a predictor that always predicts the base rate, which is the mean
    outcome. `auc` is the probability that a success gets a higher chance than a failure; NaN if all outcomes are equal.
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
    """Metrics of predicted chances (N,) in [0, 1] for outcomes (N,), 1 for success."""
    base = float(outcomes.mean())
    means, shares, counts = calibration(chances, outcomes)
    errors = np.abs(means - shares)[counts > 0]
    return Metrics(
        rows=len(outcomes),
        base_rate=base,
        accuracy=float(((chances > 0.5) == (outcomes == 1)).mean()),
        base_accuracy=max(base, 1.0 - base),
        brier=float(((chances - outcomes) ** 2).mean()),
        base_brier=base * (1.0 - base),
        calibration_error=float((errors * counts[counts > 0]).sum() / len(outcomes)),
        auc=auc(chances, outcomes),
    )


def calibration(chances: np.ndarray, outcomes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean chance, share of successes and number of predictions in each of BINS bins; NaN for empty bins."""
    bins = np.minimum((chances * BINS).astype(int), BINS - 1)
    counts = np.bincount(bins, minlength=BINS)
    with np.errstate(invalid="ignore"):
        means, shares = (np.bincount(bins, values, BINS) / counts for values in (chances, outcomes))
    return means, shares, counts


def auc(chances: np.ndarray, outcomes: np.ndarray) -> float:
    """Area under the ROC curve, a tie counts half; NaN if all outcomes are equal."""
    successes = outcomes == 1
    wins, losses = int(successes.sum()), int((~successes).sum())
    if not wins or not losses:
        return float("nan")
    return float((rankdata(chances)[successes].sum() - wins * (wins + 1) / 2) / (wins * losses))
