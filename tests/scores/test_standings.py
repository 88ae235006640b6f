"""Rows computed from scores, with numbers done by hand."""

import numpy as np
import pandas as pd
import pytest

from dextron_bench.scores import standings
from dextron_bench.splits import strata
from dextron_bench.splits.loading import load_split


def result(
    method: str, seed: int, scores: list[float], digest: str = "a" * 64, failed: int = 0, lag: float | None = None
) -> dict:
    causes = {"solved": sum(score == 20.0 for score in scores), "slipped": sum(score < 20.0 for score in scores)}
    split = {"digest": digest, "scores": scores, "failed": failed, "causes": causes, "closing_lag": lag}
    return {"method": method, "reaches": "real", "seed": seed, "splits": {"test": split}, "provenance": {}}


def test_a_row_is_the_mean_over_seeds_and_settings():
    rows = standings.table([result("bc", 0, [20, 0, 10, 20]), result("bc", 1, [20, 20, 0, 20], failed=1)])
    row = rows.iloc[0]
    assert (row["return"], row["success"], row["seeds"], row["episodes"], row["failed"]) == (13.75, 0.625, 2, 8, 1)
    assert row["return_low"] < 13.75 < row["return_high"]


def test_best_first_and_versions_of_a_split_apart():
    rows = standings.table([result("a", 0, [0.0]), result("b", 0, [20.0]), result("a", 0, [5.0], digest="b" * 64)])
    assert rows["method"].tolist() == ["b", "a", "a"]
    assert rows["version"].tolist() == ["aaaaaaaa", "bbbbbbbb", "aaaaaaaa"]


def test_a_higher_score_that_is_not_20_is_no_success():
    assert standings.table([result("a", 0, [19.0, 20.0])]).iloc[0]["success"] == 0.5


def test_endings_are_counted_over_seeds_and_lags_averaged_where_a_hand_closed():
    scores = [result("a", 0, [20.0, 3.0], lag=0.1), result("a", 1, [1.0, 2.0], lag=0.3), result("a", 2, [0.0, 0.0])]
    row = standings.table(scores).iloc[0]
    assert (row["solved"], row["slipped"], row["too late"]) == (1, 5, 0)
    assert row["closing_lag"] == 0.2


def test_no_results_make_an_empty_table():
    assert standings.table([]).empty


def noisy(method: str, lead: float, seed: int = 0, reaches: str = "real", digest: str = "a" * 64) -> dict:
    """Made-up scores of 50 rows about 10 + lead, in steps, with little noise."""
    scores = 10.0 + lead + np.random.default_rng([seed, *method.encode()]).integers(-2, 3, 50)
    return result(method, seed, scores.tolist(), digest) | {"reaches": reaches}


def column(results: list[dict], name: str) -> dict:
    return standings.table(results).set_index("method")[name].to_dict()


def test_entrants_are_ranked_and_the_ceiling_is_not():
    found = column([noisy("exp", 9.0), noisy("bc", 4.0), noisy("rl", 0.0), noisy("nothing", -6.0)], "rank")
    assert np.isnan(found.pop("exp"))
    assert found == {"bc": 1, "rl": 2, "nothing": 3}


def test_nothing_is_ranked_in_the_world_that_sim_learns_in():
    rows = standings.table([noisy("sim", 4.0, reaches="minjerk"), noisy("nothing", 0.0, reaches="minjerk")])
    assert rows["rank"].isna().all()


def test_ranks_are_by_source_split_and_version():
    rows = standings.table([noisy("a", 4.0), noisy("b", 0.0), noisy("b", 0.0, digest="b" * 64)])
    assert rows["rank"].tolist() == [1, 2, 1]


def test_regret_is_what_exp_scores_more():
    found = column([result("exp", 0, [20.0, 12.0]), result("a", 0, [10.0, 2.0]), result("a", 1, [20.0, 4.0])], "regret")
    assert found == {"exp": 0.0, "a": 7.0}


def test_without_exp_there_is_no_regret():
    assert standings.table([result("a", 0, [20.0])])["regret"].isna().all()


def test_one_more_entrant_changes_no_other_interval():
    alone = [noisy("a", 1.0, seed) for seed in range(3)]
    rows = standings.table([*(noisy("b", 5.0, seed) for seed in range(3)), *alone])
    assert rows["rank"].tolist() == [1, 2]
    pd.testing.assert_frame_equal(
        rows[rows["method"] == "a"].drop(columns="rank").reset_index(drop=True),
        standings.table(alone).drop(columns="rank"),
    )


def test_the_interquartile_mean_is_over_the_regions_of_a_split_that_ships():
    """The four regions nearest to -x score 20, nine score 0; three are cut off at either end."""
    split = load_split("real", "test")
    near = strata.strata(split)["angle"] == 0
    made = result("a", 0, np.where(near, 20.0, 0.0).tolist(), split.digest)
    row = standings.table([made]).iloc[0]
    assert row["iqm"] == 20.0 / 7  # Of 13 regions the middle seven: one that scores 20.
    assert np.isnan(standings.table([result("a", 0, [20.0])]).iloc[0]["iqm"])


def test_results_of_unequal_length_are_refused():
    with pytest.raises(standings.UnevenResults, match="test of real, version aaaaaaaa"):
        standings.table([result("a", 0, [1.0]), result("b", 0, [1.0, 2.0])])


def test_seeds_of_two_methods_are_drawn_apart():
    """A's seeds are 1 better than B's, but spread by 10: drawn together, the difference would always be 1."""
    seeds = (0.0, 9.0, 18.0)
    made = [
        result(method, k, [lead + mean] * 50)
        for method, lead in (("a", 1.0), ("b", 0.0))
        for k, mean in enumerate(seeds)
    ]
    assert column(made, "rank") == {"a": 1, "b": 1}
