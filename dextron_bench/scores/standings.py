"""The rows of the leaderboard, computed from the scores of episodes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import get_args

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.evaluation.results import Result, SplitScores
from dextron_bench.methods import registry
from dextron_bench.reaches.sources import RankedSource
from dextron_bench.scores import statistics
from dextron_bench.splits import strata
from dextron_bench.world import task

COLUMNS = (
    "method", "reaches", "split", "version", "seeds", "episodes", "failed",
    "return", "return_low", "return_high", "success", "success_low", "success_high",
    "iqm", "iqm_low", "iqm_high", "regret", *CAUSES, "closing_lag",
)  # fmt: skip


Board = dict[str, list[SplitScores]]  # By method: what each of its seeds scored on one version of a split.


def table(results: Iterable[Result]) -> pd.DataFrame:
    """One row for each method, source, split and split version, best first, with the columns COLUMNS.

    `results` are one for each seed. Success rates lie in [0, 1]. The columns
    CAUSES count episodes. `closing_lag` [s] is the mean over seeds of their medians, NaN if no hand closed. `iqm` is
    NaN for splits that do not ship, `regret` if EXP has no scores. Ranks follow from rounds alone (`scores/ranks.py`).
    Raises BadInput.
    """
    rows = [row for key, board in _boards(results).items() for row in _rows(key, board)]
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    order = ["reaches", "split", "return", "method"]
    return table.sort_values(order, ascending=[True, True, False, True], ignore_index=True)


def is_ranked(method: str, reaches: str) -> bool:
    """False for the ceiling, which receives each setting's expert, and for all methods on SIM's own reaches."""
    return method not in registry.CEILINGS and reaches in get_args(RankedSource)


def _boards(results: Iterable[Result]) -> dict[tuple[str, str, str], Board]:
    """The scores of all methods by source of reaches, split and its digest: one board holds comparable scores."""
    boards: dict[tuple[str, str, str], Board] = defaultdict(lambda: defaultdict(list))
    for result in results:
        for name, known in result.splits.items():
            boards[(result.reaches, name, known.digest)][result.method].append(known)
    return boards


def _rows(key: tuple[str, str, str], board: Board) -> Iterator[dict[str, str | float]]:
    """The rows of a board. No number of a method but its regret depends on the other methods."""
    reaches, split, digest = key
    lengths = {len(seed.scores) for seeds in board.values() for seed in seeds}
    regions = strata.start_regions(reaches, split, digest)
    lengths |= set() if regions is None else {len(regions)}  # The split's own number of rows.
    if len(lengths) > 1:
        raise BadInput(
            f"results on {split} of {reaches}, version {digest[:8]}, have different numbers of rows: "
            f"{', '.join(map(str, sorted(lengths)))}"
        )
    scores = {method: np.array([seed.scores for seed in seeds], float) for method, seeds in board.items()}
    ceiling = next((scores[method].mean() for method in registry.CEILINGS if method in scores), np.nan)
    for method, returns in scores.items():
        yield {
            "reaches": reaches,
            "split": split,
            "version": digest[:8],
            "method": method,
            "seeds": len(returns),
            "episodes": returns.size,
            **_estimates(method, returns, regions),
            "regret": ceiling - returns.mean(),
            **_endings(board[method]),
        }


def _estimates(method: str, returns: np.ndarray, regions: np.ndarray | None) -> dict[str, float]:
    """Return, success and interquartile mean of a method with their intervals; the latter only with `regions`."""
    solved = np.equal(returns, task.SUCCESS).astype(float)
    estimates = {"return": statistics.estimate(returns), "success": statistics.estimate(solved, statistics.SHARES)}
    if regions is not None:
        estimates["iqm"] = statistics.interquartile_mean(returns, regions, _method_rng(method))
    return _with_ends(estimates)


def _with_ends(estimates: Mapping[str, statistics.Estimate]) -> dict[str, float]:
    """The columns of estimates: each mean, and the ends of its interval."""
    columns: dict[str, float] = {}
    for name, estimate in estimates.items():
        columns |= {name: estimate.mean, f"{name}_low": estimate.low, f"{name}_high": estimate.high}
    return columns


def _method_rng(method: str) -> np.random.Generator:
    """A generator for each method, so that seeds of methods are independent and a new method changes no other row."""
    return np.random.default_rng([0, *method.encode()])


def _endings(seeds: list[SplitScores]) -> dict[str, float]:
    """How many episodes of all seeds end by each cause, how many failed, and the closing lag."""
    lags = [seed.closing_lag for seed in seeds if seed.closing_lag is not None]
    return {
        "failed": sum(seed.failed for seed in seeds),
        **{cause: sum(seed.causes.get(cause, 0) for seed in seeds) for cause in CAUSES},
        "closing_lag": float(np.mean(lags)) if lags else np.nan,
    }
