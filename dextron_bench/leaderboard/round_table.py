"""The table of a round: the score of each method on each source, and its rank or why it has none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.leaderboard import round_entries, rounds
from dextron_bench.leaderboard.board_rows import Row
from dextron_bench.leaderboard.round_work import read_episodes
from dextron_bench.methods import registry
from dextron_bench.scores import ranks
from dextron_bench.scores.ranks import Solved
from dextron_bench.scores.standings import is_ranked
from dextron_bench.splits.names import EVALUATED
from dextron_bench.world import task

RANKED_BY = ("unseen-reach", "unseen-subject", "hard")  # The splits that the paper has not.
SECONDS = 1200.0  # How long a seed may play a source.
EQUAL = 0.99  # A larger share of episodes with equal actions makes two methods, or two seeds, one.
TRAININGS = 3  # Seeds of a learner that has a rank.
SCORES = ("score", "score_low", "score_high")
COLUMNS = ("reaches", "method", "rank", "unranked", *SCORES, *EVALUATED, "gaps", "seeds", "round", "margin")


def table(board: Path) -> pd.DataFrame:
    """A row for each method and source of the latest round of a board, best first, with the columns COLUMNS.

    `score`, its interval and the splits are shares of settings that are solved; a split that a source lacks is NaN.
    `rank` is NaN for a method that has none, whose reason is `unranked`. `gaps` are how much more of the public `test`
    than of the fresh one each seed solves. `margin` is the margin on the source.

    Raises DamagedFile, NotFound, BadInput.
    """
    if (round_ := rounds.latest(board)) is None:
        return pd.DataFrame(columns=list(COLUMNS))
    by_name = round_entries.rows_by_name(board)
    learners = {name for name, rows in by_name.items() if round_entries.learns(rows)}
    authors = round_.commitments.authors
    episodes = read_episodes(round_)
    rows = [
        row
        for reaches, part in episodes.groupby("reaches")
        for row in _rows_of_source(str(reaches), part, learners, authors)
    ]
    methods = pd.DataFrame(rows).assign(round=round_.number)
    public = {
        (row.result.method, row.result.reaches, row.result.seed): row for rows in by_name.values() for row in rows
    }
    keys = zip(methods["method"], methods["reaches"], strict=True)
    methods["gaps"] = [_gaps(method, reaches, episodes, public) for method, reaches in keys]
    return methods.reindex(columns=list(COLUMNS)).sort_values(
        ["reaches", "score", "method"], ascending=[True, False, True], ignore_index=True
    )


def _rows_of_source(
    reaches: str, episodes: pd.DataFrame, learners: set[str], authors: Mapping[str, str]
) -> Iterator[dict[str, object]]:
    by_method = {str(method): part for method, part in episodes.groupby("method")}
    solved = {method: _solved(part) for method, part in by_method.items()}
    reasons = {
        method: _unranked(method, reaches, part, f"{method}/{reaches}" in learners)
        for method, part in by_method.items()
    }
    for method, other in _copies(by_method, authors, reaches):
        reasons[method] = reasons[method] or f"acts as {other} does"
    baselines = [
        solved[method]
        for method in solved
        if f"{method}/{reaches}" not in authors and not reasons[method] and method not in registry.FLOORS
    ]
    margin = ranks.margin(baselines).size
    scores = {method: ranks.score(part) for method, part in solved.items()}
    ranked = {method: score for method, score in scores.items() if not reasons[method]}
    by_rank = ranks.ranks(ranked, margin, {m: a for m in ranked if (a := authors.get(f"{m}/{reaches}"))})
    for method, part in solved.items():
        interval = ranks.estimate(part)
        yield {
            "reaches": reaches,
            "method": method,
            "rank": by_rank.get(method, np.nan),
            "unranked": reasons[method],
            "score": scores[method],
            "score_low": interval.low,
            "score_high": interval.high,
            **{str(name): solved_share(part) for name, part in by_method[method].groupby("split")},
            "seeds": by_method[method]["seed"].nunique(),
            "margin": margin,
        }


def solved_share(episodes: pd.DataFrame) -> float:
    """The share of episodes that are solved."""
    return float((episodes["score"] == task.SUCCESS).mean())


def _gaps(
    method: str, reaches: str, episodes: pd.DataFrame, public: Mapping[tuple[str | int, ...], Row]
) -> list[float]:
    """How much more of the public `test` than of the fresh one each seed of a method solves."""
    test = episodes[(episodes["method"] == method) & (episodes["reaches"] == reaches) & (episodes["split"] == "test")]
    gaps = []
    for seed in sorted(set(map(int, test["seed"]))):
        if row := public.get((method, reaches, seed)):
            known = np.equal(row.result.splits["test"].scores, task.SUCCESS)
            gaps.append(float(known.mean()) - solved_share(test[test["seed"] == seed]))
    return gaps


def _solved(episodes: pd.DataFrame) -> Solved:
    """What a method solves, by split of RANKED_BY that its source has."""
    ordered = episodes.sort_values(["seed", "row"])
    return {
        name: np.stack([seed["score"].to_numpy() == task.SUCCESS for _, seed in part.groupby("seed")]).astype(float)
        for name in RANKED_BY
        if len(part := ordered[ordered["split"] == name])
    }


def _unranked(method: str, reaches: str, episodes: pd.DataFrame, learns: bool) -> str:
    """Why a method that has played has no rank; empty if it has one."""
    if not is_ranked(method, reaches):
        return "a ceiling"
    if not episodes["repeats"].all():
        return "acts differently when it plays twice"
    if (episodes["seconds"] > SECONDS).any():
        return f"takes more than {SECONDS / 60:g} minutes for a seed"
    seeds = _different_seeds(episodes)
    if (learns or seeds > 1) and seeds < TRAININGS:
        return f"fewer than {TRAININGS} trainings"
    return ""


def _different_seeds(episodes: pd.DataFrame) -> int:
    """How many seeds of a method act differently."""
    different: list[np.ndarray] = []
    for _, part in episodes.groupby("seed"):
        actions = _actions(part)
        if not any(np.mean(actions == other) >= EQUAL for other in different):
            different.append(actions)
    return len(different)


def _copies(
    by_method: Mapping[str, pd.DataFrame], authors: Mapping[str, str], reaches: str
) -> Iterator[tuple[str, str]]:
    """Each method whose seeds all act as the first seeds of another, which is the original: baselines come first."""
    order = sorted(by_method, key=lambda method: (f"{method}/{reaches}" in authors, method))
    originals: dict[str, list[np.ndarray]] = {}
    for method in order:
        seeds = [_actions(part) for _, part in by_method[method].groupby("seed")]
        for other, theirs in originals.items():
            if all(any(np.mean(one == their) >= EQUAL for their in theirs) for one in seeds):
                yield method, other
                break
        else:
            originals[method] = seeds


def _actions(episodes: pd.DataFrame) -> np.ndarray:
    """The hashes of the actions of a seed's episodes, in order."""
    return episodes.sort_values(["split", "row"])["actions"].to_numpy()
