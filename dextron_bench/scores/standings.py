"""The rows of the leaderboard, computed from the scores of episodes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.evaluation.results import Result, SplitScores
from dextron_bench.methods import registry
from dextron_bench.reaches.sources import RankedSource
from dextron_bench.scores import paired, statistics
from dextron_bench.splits import strata
from dextron_bench.splits.fresh_settings import FreshSplitScores
from dextron_bench.world import task

COLUMNS = (
    "rank", "method", "reaches", "split", "version", "seeds", "episodes", "failed",
    "return", "return_low", "return_high", "success", "success_low", "success_high",
    "iqm", "iqm_low", "iqm_high", "regret", *CAUSES, "closing_lag",
    "fresh", "fresh_low", "fresh_high", "gap", "gap_low", "gap_high", "marked",
)  # fmt: skip


class Seed(NamedTuple):
    """What a seed of a method scored on a split, and on fresh settings of it if it has played any."""

    known: SplitScores
    fresh: FreshSplitScores | None


Board = dict[str, list[Seed]]  # By method: what each of its seeds scored on one version of a split.


@dataclass(frozen=True, slots=True)
class FreshReturn:
    """What a method scores on fresh settings (seeds, settings), and how much less that is than on known ones."""

    scores: np.ndarray
    gap: paired.Gap


def table(results: Iterable[Result]) -> pd.DataFrame:
    """One row for each method, source, split and split version, best first, with the columns COLUMNS.

    `results` are one for each seed. Success rates lie in [0, 1]. The columns
    CAUSES count episodes. `closing_lag` [s] is the mean over seeds of their medians, NaN if no hand closed. `rank` is
    NaN for methods that are not ranked, `iqm` for splits that do not ship, `regret` if EXP has no scores.

    `fresh` is the mean return on fresh settings, and `gap` how much higher `return` is; NaN if some seed did not play
    fresh settings. A row is `marked` if its gap is beyond noise; its place and its rank then follow from `fresh`.
    Raises BadInput.
    """
    rows = [row for key, board in _boards(results).items() for row in _rows(key, board)]
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    ranked_by = table["return"].where(~table["marked"].astype(bool), table["fresh"])
    order = ["reaches", "split", "ranked_by", "method"]
    return (
        table.assign(ranked_by=ranked_by)
        .sort_values(order, ascending=[True, True, False, True], ignore_index=True)
        .drop(columns="ranked_by")
    )


def is_ranked(method: str, reaches: str) -> bool:
    """False for the ceiling, which receives each setting's expert, and for all methods on SIM's own reaches."""
    return method not in registry.CEILINGS and reaches in get_args(RankedSource)


def _boards(results: Iterable[Result]) -> dict[tuple[str, str, str], Board]:
    """The scores of all methods by source of reaches, split and its digest: one board holds comparable scores."""
    boards: dict[tuple[str, str, str], Board] = defaultdict(lambda: defaultdict(list))
    for result in results:
        for name, known in result.splits.items():
            fresh = result.fresh.splits.get(name) if result.fresh else None
            boards[(result.reaches, name, known.digest)][result.method].append(Seed(known, fresh))
    return boards


def _rows(key: tuple[str, str, str], board: Board) -> Iterator[dict[str, Any]]:
    """The rows of a board. Of a method's numbers, only its rank depends on the other methods."""
    reaches, split, digest = key
    lengths = {len(seed.known.scores) for seeds in board.values() for seed in seeds}
    regions = strata.start_regions(reaches, split, digest)
    lengths |= set() if regions is None else {len(regions)}  # The split's own number of rows.
    if len(lengths) > 1:
        raise BadInput(
            f"results on {split} of {reaches}, version {digest[:8]}, have different numbers of rows: "
            f"{', '.join(map(str, sorted(lengths)))}"
        )
    scores = {method: np.array([seed.known.scores for seed in seeds], float) for method, seeds in board.items()}
    fresh = {method: _fresh(seeds, scores[method]) for method, seeds in board.items()}
    marked = {method: known.scores for method, known in fresh.items() if known and known.gap.is_beyond_noise}
    ranked = [method for method in scores if is_ranked(method, reaches)]
    own_settings = [place for place, method in enumerate(ranked) if method in marked]
    ranked_by = [marked.get(method, scores[method]) for method in ranked]
    ranks = dict(zip(ranked, paired.ranks(ranked_by, own_settings), strict=True))
    ceiling = next((scores[method].mean() for method in registry.CEILINGS if method in scores), np.nan)
    for method, returns in scores.items():
        yield {
            "reaches": reaches,
            "split": split,
            "version": digest[:8],
            "rank": ranks.get(method, np.nan),
            "method": method,
            "seeds": len(returns),
            "episodes": returns.size,
            **_estimates(method, returns, regions),
            "regret": ceiling - returns.mean(),
            **_endings([seed.known for seed in board[method]]),
            **_fresh_columns(fresh[method]),
        }


def _fresh(seeds: Sequence[Seed], known: np.ndarray) -> FreshReturn | None:
    """The scores of a method on fresh settings; None if some seed has none, or if seeds played different ones."""
    played = [seed.fresh for seed in seeds if seed.fresh]
    if len(played) < len(seeds) or len({one.digest for one in played}) > 1:
        return None
    scores = np.array([one.scores for one in played], float)
    return FreshReturn(scores, paired.gap(known, scores))


def _fresh_columns(fresh: FreshReturn | None) -> dict[str, float]:
    """Mean return on fresh settings and gap with their intervals, and whether the gap is beyond noise."""
    if fresh is None:
        return {"marked": False}
    estimates = {"fresh": statistics.estimate(fresh.scores), "gap": fresh.gap}
    return {"marked": fresh.gap.is_beyond_noise} | _with_ends(estimates)


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
