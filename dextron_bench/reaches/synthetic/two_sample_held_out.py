"""Recorded reaches, and synthetic reaches from models that were not fitted to them; and folds for classifiers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.synthetic.fitting import fit
from dextron_bench.reaches.synthetic.generator import generate
from dextron_bench.reaches.synthetic.parameters import ANGLES, REGIONS

FOLDS = 5
SUBJECT_FOLDS = 3
COPIES = 2  # Synthetic reaches for each recorded one.

Tick = Callable[[], None]  # Called after each fitted model and each classifier.


def no_tick() -> None:
    """A Tick that does nothing."""


def held_out(reaches: Sequence[Reach], seed: int, tick: Tick = no_tick) -> list[Reach]:
    """Synthetic counterparts of recorded reaches, each from a model that was not fitted to the recorded reach.

    The recorded reaches are divided into FOLDS. For each reach of a fold, the model of the other folds generates COPIES
    with the same start region and session.
    """
    sessions = sorted({session(reach) for reach in reaches})
    region = np.array([ANGLES * r.ring + r.angle for r in reaches])
    fold = folds(region, FOLDS, np.random.default_rng(seed))
    counterparts = []
    for k in range(FOLDS):
        model = fit([r for r, f in zip(reaches, fold, strict=True) if f != k], seed)
        for reach in (r for r, f in zip(reaches, fold, strict=True) if f == k):
            cell = ANGLES * reach.ring + reach.angle + REGIONS * sessions.index(session(reach))
            counterparts += [generate(cell + REGIONS * len(sessions) * copy, model) for copy in range(COPIES)]
        tick()
    return counterparts


def held_out_subjects(reaches: Sequence[Reach], seed: int) -> Iterator[tuple[list[Reach], list[Reach], list[Reach]]]:
    """Yields recorded reaches of some subjects, synthetic reaches of a model of the other subjects, and theirs.

    The subjects are divided into SUBJECT_FOLDS. A classifier can distinguish people, so synthetic reaches of new
    subjects are at best as similar to the first list as the third list is.
    """
    subjects = sorted({reach.subject for reach in reaches})
    fold = folds(np.zeros(len(subjects)), SUBJECT_FOLDS, np.random.default_rng(seed))
    for k in range(SUBJECT_FOLDS):
        held = {subject for subject, f in zip(subjects, fold, strict=True) if f == k}
        others = [reach for reach in reaches if reach.subject not in held]
        model = fit(others, seed)
        yield [r for r in reaches if r.subject in held], [generate(i, model) for i in range(len(others))], others


def cell_folds(real: Sequence[Reach], synthetic: Sequence[Reach], rng: np.random.Generator) -> np.ndarray:
    """Fold (n,) of each recorded and then each synthetic reach. One subject's reaches from one region share a fold.

    If they were in different folds, a held-out recorded reach would mostly have synthetic neighbours in the training
    data. The classifier would call it synthetic, and its AUC would fall below 0.5. The k-th virtual subject shares its
    folds with the k-th recorded one.
    """
    cells = []
    for reaches in (real, synthetic):
        subjects = sorted({reach.subject for reach in reaches})
        cells += [(subjects.index(r.subject) * ANGLES + r.ring) * ANGLES + r.angle for r in reaches]
    distinct, cell = np.unique(cells, return_inverse=True)
    return rng.permutation(len(distinct))[cell] % FOLDS


def folds(labels: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Fold (n,) of each row. The rows with one label (n,) are spread evenly over the folds."""
    fold = np.zeros(len(labels), int)
    for label in np.unique(labels):
        rows = rng.permutation(np.flatnonzero(labels == label))
        fold[rows] = (np.arange(len(rows)) + rng.integers(count)) % count
    return fold


def session(reach: Reach) -> str:
    """The session of a recorded reach: its name up to the last underscore."""
    return reach.name.rpartition("_")[0]
