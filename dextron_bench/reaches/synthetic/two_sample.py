"""How far synthetic reaches are from recorded ones: the AUC of classifiers that try to tell them apart.

0.5 says that a classifier is guessing, 1 that it is never wrong (classifier two-sample test; Lopez-Paz and
Oquab, 2017). Every reach is judged by a classifier that has not seen it. Needs scikit-learn, from the
`dev` extra: a proof of likeness is worth what its classifier is, and theirs are known.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.synthetic.fitting import fit
from dextron_bench.reaches.synthetic.generator import ANGLES, COUNT, REGIONS, generate, shipped
from dextron_bench.reaches.synthetic.two_sample_features import GROUPS, alone, features, nearest, strata, summaries

FOLDS = 5
PEOPLE_FOLDS = 3
COPIES = 2  # Synthetic reaches for each recorded one.
TREES = 100
LEAF = 3  # Reaches in a leaf at least.
RIDGE = 0.01  # Inverse strength of the penalty on standardised coefficients.
REPEATS = 400  # Of the bootstrap.
LEVELS = (0.025, 0.975)

Tick = Callable[[], None]  # Called after each model that was fitted, and each classifier.


class MissingClassifiers(ImportError):
    """scikit-learn is not installed."""

    def __init__(self) -> None:
        super().__init__("the test of likeness needs scikit-learn: `pip install scikit-learn`")


def silent() -> None:
    """A Tick that tells nobody."""


def study(
    real: Sequence[Reach], seed: int, progress: Callable[[int, int], None] = lambda done, total: None
) -> dict[str, pd.DataFrame]:
    """Tables of how alike synthetic and recorded reaches are: `held out` is a `report`, the others have its names.

    `nearest` looks at the shipped reaches, all others at models that have not seen the reaches they are judged by.
    Raises MissingClassifiers before anything is computed.
    """
    judgements = (len(GROUPS) + 1) * len(classifiers(seed))
    total, done = FOLDS + judgements + PEOPLE_FOLDS * (1 + 2 * judgements), itertools.count(1)

    def tick() -> None:
        progress(next(done), total)

    synthetic, model = held_out(real, seed, tick), shipped()
    return {
        "held out": report(real, synthetic, seed, tick),
        "alone": alone(real, synthetic),
        "nearest": nearest(real, [generate(number, model) for number in range(COUNT)]),
        "distributions": summaries(real, synthetic),
        "strangers": strangers(real, seed, tick),
    }


def report(real: Sequence[Reach], synthetic: Sequence[Reach], seed: int, tick: Tick = silent) -> pd.DataFrame:
    """AUCs with 95 % intervals: a row for each group of features, classifier and stratum of start regions.

    Columns group, classifier, stratum, auc, low, high, real and synthetic (numbers of reaches). Strata are `all`,
    each ring, each angle, and each start region `ring-angle`, all judged by classifiers of all regions.
    Raises MissingClassifiers.
    """
    reaches = [*real, *synthetic]
    made = np.arange(len(reaches)) >= len(real)
    groups = features(reaches)
    groups["everything"] = np.concatenate(list(groups.values()), axis=1)
    rng = np.random.default_rng(seed)
    fold = cell_folds(real, synthetic, rng)
    rows = []
    for group, values in groups.items():
        for classifier, build in classifiers(seed).items():
            scores = judged(build, values, made, fold)
            for stratum, member in strata(reaches):
                interval = auc_interval(scores[member & ~made], scores[member & made], rng)
                counts = {"real": int((member & ~made).sum()), "synthetic": int((member & made).sum())}
                rows.append({"group": group, "classifier": classifier, "stratum": stratum, **interval, **counts})
            tick()
    return pd.DataFrame(rows)


def classifiers(seed: int) -> dict[str, Callable[[], Any]]:
    """Builders of the classifiers by name; raises MissingClassifiers."""
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


def judged(build: Callable[[], Any], values: np.ndarray, made: np.ndarray, fold: np.ndarray) -> np.ndarray:
    """Probability (n,) that each row of values (n, k) is synthetic, by a classifier of the other folds (n,)."""
    scores = np.zeros(len(values))
    for k in np.unique(fold):
        model = build().fit(values[fold != k], made[fold != k])
        scores[fold == k] = model.predict_proba(values[fold == k])[:, 1]
    return scores


def cell_folds(real: Sequence[Reach], synthetic: Sequence[Reach], rng: np.random.Generator) -> np.ndarray:
    """Fold (n,) of each recorded, then each synthetic reach; a subject's reaches from one start region share one.

    Were they spread, a classifier would find mostly synthetic ones like the recorded one it has not seen, call it
    synthetic, and come out below 0.5. The k-th virtual subject counts as the k-th recorded one.
    """
    cells = []
    for reaches in (real, synthetic):
        people = sorted({reach.subject for reach in reaches})
        cells += [(people.index(r.subject) * ANGLES + r.ring) * ANGLES + r.angle for r in reaches]
    distinct, cell = np.unique(cells, return_inverse=True)
    return rng.permutation(len(distinct))[cell] % FOLDS


def folds(labels: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Fold (n,) of each row, every label (n,) spread evenly over the folds."""
    fold = np.zeros(len(labels), int)
    for label in np.unique(labels):
        rows = rng.permutation(np.flatnonzero(labels == label))
        fold[rows] = (np.arange(len(rows)) + rng.integers(count)) % count
    return fold


def auc_interval(low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> dict[str, float]:
    """AUC of scores of recorded (m,) and synthetic (n,) reaches, with a 95 % bootstrap interval; NaN without any."""
    if not (len(low) and len(high)):
        return {"auc": np.nan, "low": np.nan, "high": np.nan}
    wins = (high[None, :] > low[:, None]) + 0.5 * (high[None, :] == low[:, None])
    weigh = [rng.multinomial(n, np.full(n, 1.0 / n), REPEATS) / n for n in wins.shape]
    bounds = np.quantile(((weigh[0] @ wins) * weigh[1]).sum(axis=1), LEVELS)
    return {"auc": float(wins.mean()), "low": float(bounds[0]), "high": float(bounds[1])}


def held_out(reaches: Sequence[Reach], seed: int, tick: Tick = silent) -> list[Reach]:
    """Synthetic reaches to set beside recorded ones, each from a model that was not fitted to its counterpart.

    The recorded reaches are spread over FOLDS; for each one in a fold, COPIES are made of the same start region
    and session by the model of the other folds.
    """
    sessions = sorted({session(reach) for reach in reaches})
    region = np.array([ANGLES * r.ring + r.angle for r in reaches])
    fold = folds(region, FOLDS, np.random.default_rng(seed))
    out = []
    for k in range(FOLDS):
        model = fit([r for r, f in zip(reaches, fold, strict=True) if f != k], seed)
        for reach in (r for r, f in zip(reaches, fold, strict=True) if f == k):
            cell = ANGLES * reach.ring + reach.angle + REGIONS * sessions.index(session(reach))
            out += [generate(cell + REGIONS * len(sessions) * copy, model) for copy in range(COPIES)]
        tick()
    return out


def strangers(reaches: Sequence[Reach], seed: int, tick: Tick = silent) -> pd.DataFrame:
    """AUCs for subjects whom the model has not seen, mean, least and greatest of PEOPLE_FOLDS splits.

    Columns group, classifier, beside, auc, low, high. Recorded reaches of some subjects are told from those that are
    `beside` them: `synthetic` ones of a model of the other subjects, or the recorded ones of these `people`.
    """
    parts = []
    for away, made, others in held_out_subjects(reaches, seed):
        tick()
        for beside, rows in (("synthetic", made), ("people", others)):
            parts.append(report(away, rows, seed, tick).query("stratum == 'all'").assign(beside=beside))
    grouped = pd.concat(parts).groupby(["group", "classifier", "beside"], sort=False)["auc"]
    return grouped.agg(auc="mean", low="min", high="max").reset_index()


def held_out_subjects(reaches: Sequence[Reach], seed: int) -> Iterator[tuple[list[Reach], list[Reach], list[Reach]]]:
    """Recorded reaches of some subjects, synthetic ones of a model of the others, and the others' own.

    The subjects are spread over PEOPLE_FOLDS. A classifier can tell people apart: how well it tells the first
    from the third is what synthetic reaches of strangers can hope for.
    """
    people = sorted({reach.subject for reach in reaches})
    fold = folds(np.zeros(len(people)), PEOPLE_FOLDS, np.random.default_rng(seed))
    for k in range(PEOPLE_FOLDS):
        away = {person for person, f in zip(people, fold, strict=True) if f == k}
        others = [reach for reach in reaches if reach.subject not in away]
        model = fit(others, seed)
        yield [r for r in reaches if r.subject in away], [generate(i, model) for i in range(len(others))], others


def session(reach: Reach) -> str:
    """The session of a recorded reach: its name up to the last underscore."""
    return reach.name.rpartition("_")[0]
