"""Groups of a split's rows: by subject, and by the region in which the hand starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from dextron_bench.reaches import sources
from dextron_bench.reaches.recorded import parsing
from dextron_bench.splits.loading import Split, UnknownSplit, load_split
from dextron_bench.storage import hashing
from dextron_bench.world import task

SUBJECT, REGION = ("subject",), ("ring", "angle")  # What `by_stratum` groups by.


def strata(split: Split) -> pd.DataFrame:
    """Columns `subject`, `ring` 0 (near) to 3 (far) and `angle` 0 (-x) to 3 (-y), for each row of a split in order.

    For recorded reaches their names are enough; the recordings need not be imported. Raises UnknownReach.
    """
    names = [case.setting.reach for case in split.cases]
    if split.reaches == "real":
        rows = [parsing.subject_and_region(name) for name in names]
    else:
        source = sources.open_source(split.reaches)
        rows = [(stratum.subject, stratum.ring, stratum.angle) for stratum in map(source.stratum, names)]
    return pd.DataFrame(rows, columns=["subject", "ring", "angle"])


def by_subject(split: Split, subject: str) -> tuple[Split, Split]:
    """The rows of a split with a subject's reaches, and all other rows, each with a digest of its own.

    Raises UnknownReach.
    """
    subjects = strata(split)["subject"].to_numpy()
    parts = []
    for word, chosen in (("with", subjects == subject), ("without", subjects != subject)):
        part, digest = split.rows(np.flatnonzero(chosen)), hashing.digest(f"{split.digest} {word} {subject}".encode())
        parts.append(replace(split, cases=part.cases, bottles=part.bottles, digest=digest))
    return parts[0], parts[1]


def shipped_strata(reaches: str, name: str, digest: str) -> pd.DataFrame | None:
    """The strata of a shipped split's rows; None if no split of that name and digest ships. Raises BadInput."""
    try:
        split = load_split(reaches, name)
    except UnknownSplit:
        return None
    return strata(split) if split.digest == digest else None


def start_regions(reaches: str, name: str, digest: str) -> np.ndarray | None:
    """Start regions (rows,) of a shipped split as numbers 0 to 15, 4 ring + angle; None if `shipped_strata` is None."""
    rows = shipped_strata(reaches, name, digest)
    return None if rows is None else (4 * rows["ring"] + rows["angle"]).to_numpy()


def by_stratum(scores: np.ndarray, rows: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Mean return and success rate of scores (seeds, rows) in each group of rows, which come from `strata`.

    `by` is SUBJECT or REGION. Columns: `by`, then `rows` (how many), `return` (0 to 20), `success` (0 to 1). Groups
    without rows are left out.
    """
    scored = rows[list(by)].assign(score=scores.mean(axis=0), solved=np.equal(scores, task.SUCCESS).mean(axis=0))
    return (
        scored.groupby(list(by))
        .agg(**{"rows": ("score", "size"), "return": ("score", "mean"), "success": ("solved", "mean")})
        .reset_index()
    )
