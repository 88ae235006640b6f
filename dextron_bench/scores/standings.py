"""The leaderboard: rows computed from the scores of episodes, never typed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.methods import registry
from dextron_bench.scores import paired, statistics
from dextron_bench.splits import strata
from dextron_bench.world import task

COLUMNS = (
    "rank", "method", "reaches", "split", "version", "seeds", "episodes", "failed",
    "return", "return_low", "return_high", "success", "success_low", "success_high",
    "iqm", "iqm_low", "iqm_high", "regret", *CAUSES, "closing_lag",
)  # fmt: skip
CONTESTED = ("real", "synthetic")  # Sources on which methods are ranked; SIM's own world is none.
Board = dict[str, list[dict[str, Any]]]  # By method, what each of its seeds scored on one version of a split.


class UnevenResults(ValueError):
    """Results of one version of a split that have not the same number of rows."""


def table(results: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """One row for each method, source, split and split version, best first, with the columns COLUMNS.

    `results` are the contents of `result.json` files, one a seed. Success rates lie in [0, 1], the columns CAUSES are
    numbers of episodes, `closing_lag` [s] is the mean over seeds of their medians, NaN where no hand closed. `rank` is
    NaN for who is no entrant, `iqm` where the split is not one that ships, `regret` where EXP has no scores.
    Raises UnevenResults.
    """
    found = [row for key, board in _boards(results).items() for row in _rows(key, board)]
    return pd.DataFrame(found, columns=list(COLUMNS)).sort_values(
        ["reaches", "split", "return", "method"], ascending=[True, True, False, True], ignore_index=True
    )


def is_entrant(method: str, reaches: str) -> bool:
    """Whether a method is ranked: not the ceiling, which is told each setting's expert, and not in SIM's own world."""
    return method not in registry.CEILINGS and reaches in CONTESTED


def _boards(results: Iterable[dict[str, Any]]) -> dict[tuple[str, str, str], Board]:
    """What can be compared: the scores of all methods by source of reaches, split and its digest."""
    boards: dict[tuple[str, str, str], Board] = defaultdict(lambda: defaultdict(list))
    for result in results:
        for name, found in result["splits"].items():
            boards[(result["reaches"], name, found["digest"])][result["method"]].append(found)
    return boards


def _rows(key: tuple[str, str, str], board: Board) -> Iterator[dict[str, Any]]:
    """The rows of a board. A method's numbers do not depend on who else is there, but for its rank."""
    reaches, split, digest = key
    lengths = {len(found["scores"]) for seeds in board.values() for found in seeds}
    if len(lengths) > 1:
        raise UnevenResults(f"results on {split} of {reaches}, version {digest[:8]}, differ in their number of rows")
    scores = {method: np.array([found["scores"] for found in seeds], float) for method, seeds in board.items()}
    settings = statistics.drawn(lengths.pop(), np.random.default_rng(0))
    resamples = {method: statistics.resampled(each, settings, _stream(method)) for method, each in scores.items()}
    entrants = [method for method in scores if is_entrant(method, reaches)]
    ranks = dict(zip(entrants, paired.ranks([scores[method] for method in entrants]), strict=True))
    regions = strata.regions(reaches, split, digest)
    ceiling = next((scores[method].mean() for method in registry.CEILINGS if method in scores), np.nan)
    for method, each in scores.items():
        solved = np.equal(each, task.SUCCESS).astype(float)
        yield {
            **dict(zip(("reaches", "split", "version"), (reaches, split, digest[:8]), strict=True)),
            **{"rank": ranks.get(method, np.nan), "method": method, "seeds": len(each), "episodes": each.size},
            **_spread("return", statistics.interval(float(each.mean()), resamples[method])),
            **_spread(
                "success", statistics.interval(solved.mean(), statistics.resampled(solved, settings, _stream(method)))
            ),
            **(
                _spread("iqm", statistics.interquartile_mean(each, regions, _stream(method)))
                if regions is not None
                else {}
            ),
            "regret": ceiling - each.mean(),
            **_endings(board[method]),
        }


def _stream(method: str) -> np.random.Generator:
    """Each method's own random numbers, so that methods' seeds are drawn independently and one more changes none."""
    return np.random.default_rng([0, *method.encode()])


def _spread(name: str, found: statistics.Estimate) -> dict[str, float]:
    return {name: found.mean, f"{name}_low": found.low, f"{name}_high": found.high}


def _endings(seeds: list[dict[str, Any]]) -> dict[str, Any]:
    """How the episodes of all seeds end."""
    lags = [found["closing_lag"] for found in seeds if found["closing_lag"] is not None]
    return {
        "failed": sum(found["failed"] for found in seeds),
        **{cause: sum(found["causes"].get(cause, 0) for found in seeds) for cause in CAUSES},
        "closing_lag": float(np.mean(lags)) if lags else np.nan,
    }
