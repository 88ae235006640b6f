"""The leaderboard: rows computed from the scores of episodes, never typed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench import stats
from dextron_bench.diagnosis import CAUSES
from dextron_bench.world import task

COLUMNS = (
    "method", "reaches", "split", "version", "seeds", "episodes", "failed",
    "return", "return_low", "return_high", "success", "success_low", "success_high", *CAUSES, "closing_lag",
)  # fmt: skip


def table(results: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """One row for each method, source, split and split version, best first, with the columns COLUMNS.

    `results` are the contents of `result.json` files, one a seed. Success rates lie in [0, 1], the columns CAUSES are
    numbers of episodes, `closing_lag` [s] is the mean over seeds of their medians, NaN where no hand closed.
    """
    rows = pd.DataFrame([_row(key, seeds) for key, seeds in _groups(results).items()], columns=list(COLUMNS))
    return rows.sort_values(
        ["reaches", "split", "return", "method"], ascending=[True, True, False, True], ignore_index=True
    )


def _groups(results: Iterable[dict[str, Any]]) -> dict[tuple[str, str, str, str], list[dict[str, Any]]]:
    """What each seed scored, by method, source of reaches, split and its digest."""
    groups: dict[tuple[str, str, str, str], list[dict[str, Any]]] = defaultdict(list)
    for result in results:
        for name, found in result["splits"].items():
            groups[(result["method"], result["reaches"], name, found["digest"])].append(found)
    return groups


def _row(key: tuple[str, ...], seeds: list[dict[str, Any]]) -> list[Any]:
    method, reaches, split, digest = key
    scores = np.array([found["scores"] for found in seeds], float)
    mean = stats.estimate(scores, np.random.default_rng(0))
    success = stats.estimate(np.equal(scores, task.SUCCESS).astype(float), np.random.default_rng(0))
    failed = sum(found["failed"] for found in seeds)
    causes = [sum(found["causes"].get(cause, 0) for found in seeds) for cause in CAUSES]
    lags = [found["closing_lag"] for found in seeds if found["closing_lag"] is not None]
    return [
        method, reaches, split, digest[:8], len(seeds), scores.size, failed,
        mean.mean, mean.low, mean.high, success.mean, success.low, success.high,
        *causes, float(np.mean(lags)) if lags else np.nan,
    ]  # fmt: skip
