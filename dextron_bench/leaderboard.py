"""The leaderboard: rows computed from the scores of episodes, never typed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench import stats
from dextron_bench.world import task

COLUMNS = (
    "method", "reaches", "split", "version", "seeds", "episodes", "failed",
    "return", "return_low", "return_high", "success", "success_low", "success_high",
)  # fmt: skip


def table(results: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """One row for each method, source, split and split version, best first, with the columns COLUMNS.

    `results` are the contents of `result.json` files, one a seed. Success rates lie in [0, 1].
    """
    groups: dict[tuple[str, ...], list[dict[str, Any]]] = defaultdict(list)
    for result in results:
        for name, found in result["splits"].items():
            groups[(result["method"], result["reaches"], name, found["digest"])].append(found)
    rows = pd.DataFrame([_row(key, seeds) for key, seeds in groups.items()], columns=list(COLUMNS))
    return rows.sort_values(
        ["reaches", "split", "return", "method"], ascending=[True, True, False, True], ignore_index=True
    )


def _row(key: tuple[str, ...], seeds: list[dict[str, Any]]) -> list[Any]:
    method, reaches, split, digest = key
    scores = np.array([found["scores"] for found in seeds], float)
    mean = stats.estimate(scores, np.random.default_rng(0))
    success = stats.estimate(np.equal(scores, task.SUCCESS).astype(float), np.random.default_rng(0))
    failed = sum(found["failed"] for found in seeds)
    return [
        method, reaches, split, digest[:8], len(seeds), scores.size, failed,
        mean.mean, mean.low, mean.high, success.mean, success.low, success.high,
    ]  # fmt: skip
