"""Two-sample test of synthetic against recorded reaches: the AUC of classifiers that distinguish them.

An AUC of 0.5 means that a classifier guesses, 1 that it is always right (classifier two-sample test; Lopez-Paz and
Oquab, 2017). No classifier scores a reach that it was trained on. The test needs scikit-learn, from the `dev` extra:
its result depends on the classifiers, and the classifiers of scikit-learn are well known.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.errors import MissingPackage
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.synthetic.generator import COUNT, generate
from dextron_bench.reaches.synthetic.parameters import shipped_parameters
from dextron_bench.reaches.synthetic.two_sample_features import (
    GROUPS,
    features,
    nearest_recorded,
    single_feature_aucs,
    strata,
    summaries,
)
from dextron_bench.reaches.synthetic.two_sample_held_out import (
    FOLDS,
    SUBJECT_FOLDS,
    Tick,
    cell_folds,
    held_out,
    held_out_subjects,
    no_tick,
)
from dextron_bench.storage.progress import Progress, no_progress

TREES = 100
LEAF = 3  # Fewest reaches in a leaf.
RIDGE = 0.01  # Inverse strength of the penalty on standardised coefficients.
REPEATS = 400  # Resamples of the bootstrap.
LEVELS = (0.025, 0.975)


class MissingClassifiers(MissingPackage):
    """scikit-learn is not installed."""

    def __init__(self) -> None:
        super().__init__("the two-sample test needs scikit-learn: `pip install scikit-learn`")


def study(real: Sequence[Reach], seed: int, progress: Progress = no_progress) -> dict[str, pd.DataFrame]:
    """All tables of the two-sample test, by name.

    `nearest` is about the shipped reaches. All other tables are about models that were not fitted to the recorded
    reaches in the comparison. Calls `progress` with the numbers of steps done and in all. Raises MissingClassifiers
    before it computes anything.
    """
    fits = (len(GROUPS) + 1) * len(classifiers(seed))
    total, done = FOLDS + fits + SUBJECT_FOLDS * (1 + 2 * fits), itertools.count(1)

    def tick() -> None:
        progress(next(done), total)

    synthetic, model = held_out(real, seed, tick), shipped_parameters()
    return {
        "held out": auc_table(real, synthetic, seed, tick),
        "alone": single_feature_aucs(real, synthetic),
        "nearest": nearest_recorded(real, [generate(number, model) for number in range(COUNT)]),
        "distributions": summaries(real, synthetic),
        "strangers": new_subject_aucs(real, seed, tick),
    }


def auc_table(real: Sequence[Reach], synthetic: Sequence[Reach], seed: int, tick: Tick = no_tick) -> pd.DataFrame:
    """AUCs with 95 % intervals: one row for each group of features, classifier and stratum of start regions.

    The columns are group, classifier, stratum, auc, low, high, real and synthetic (numbers of reaches). The strata are
    `all`, each ring, each angle, and each start region `ring-angle`. One classifier of all regions scores all strata.
    Raises MissingClassifiers.
    """
    reaches = [*real, *synthetic]
    is_synthetic = np.arange(len(reaches)) >= len(real)
    groups = features(reaches)
    groups["everything"] = np.concatenate(list(groups.values()), axis=1)
    rng = np.random.default_rng(seed)
    fold = cell_folds(real, synthetic, rng)
    rows = []
    for group, values in groups.items():
        for classifier, build in classifiers(seed).items():
            scores = cross_predict(build, values, is_synthetic, fold)
            for stratum, member in strata(reaches):
                interval = auc_interval(scores[member & ~is_synthetic], scores[member & is_synthetic], rng)
                counts = {"real": int((member & ~is_synthetic).sum()), "synthetic": int((member & is_synthetic).sum())}
                rows.append({"group": group, "classifier": classifier, "stratum": stratum, **interval, **counts})
            tick()
    return pd.DataFrame(rows)


def classifiers(seed: int) -> dict[str, Callable[[], Any]]:
    """Functions that build the classifiers, by name. Raises MissingClassifiers."""
    try:
        from sklearn.ensemble import RandomForestClassifier
        from sklearn.linear_model import LogisticRegression
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler
    except ImportError:
        raise MissingClassifiers from None
    return {
        "logistic": lambda: make_pipeline(StandardScaler(), LogisticRegression(C=RIDGE, max_iter=500)),
        "forest": lambda: RandomForestClassifier(TREES, min_samples_leaf=LEAF, random_state=seed),
    }


def cross_predict(
    build: Callable[[], Any], values: np.ndarray, is_synthetic: np.ndarray, fold: np.ndarray
) -> np.ndarray:
    """Probability (n,) that each row of values (n, k) is synthetic, from a classifier of the other folds (n,)."""
    scores = np.zeros(len(values))
    for k in np.unique(fold):
        model = build().fit(values[fold != k], is_synthetic[fold != k])
        scores[fold == k] = model.predict_proba(values[fold == k])[:, 1]
    return scores


def auc_interval(real: np.ndarray, synthetic: np.ndarray, rng: np.random.Generator) -> dict[str, float]:
    """AUC of scores of m recorded and n synthetic reaches, with a 95 % bootstrap interval; NaN if either is empty."""
    if not (len(real) and len(synthetic)):
        return {"auc": np.nan, "low": np.nan, "high": np.nan}
    wins = (synthetic[None, :] > real[:, None]) + 0.5 * (synthetic[None, :] == real[:, None])
    weights = [rng.multinomial(n, np.full(n, 1.0 / n), REPEATS) / n for n in wins.shape]
    bounds = np.quantile(((weights[0] @ wins) * weights[1]).sum(axis=1), LEVELS)
    return {"auc": float(wins.mean()), "low": float(bounds[0]), "high": float(bounds[1])}


def new_subject_aucs(reaches: Sequence[Reach], seed: int, tick: Tick = no_tick) -> pd.DataFrame:
    """AUCs for subjects that the model was not fitted to: mean, least and greatest of SUBJECT_FOLDS folds.

    The columns are group, classifier, beside, auc, low and high. The classifiers distinguish the recorded reaches of
    some subjects from other reaches. These are `synthetic` ones, of a model of the other subjects, or the recorded ones
    of these other `people`.
    """
    parts = []
    for recorded, synthetic, others in held_out_subjects(reaches, seed):
        tick()
        for beside, rows in (("synthetic", synthetic), ("people", others)):
            parts.append(auc_table(recorded, rows, seed, tick).query("stratum == 'all'").assign(beside=beside))
    grouped = pd.concat(parts).groupby(["group", "classifier", "beside"], sort=False)["auc"]
    return grouped.agg(auc="mean", low="min", high="max").reset_index()
