"""Rows of the leaderboard, compared with numbers computed by hand."""

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.results import Result
from dextron_bench.scores import standings
from dextron_bench.splits import strata
from dextron_bench.splits.loading import load_split
from tests.helpers import results


def result(
    method: str, seed: int, scores: list[float], digest: str = "a" * 64, failed: int = 0, lag: float | None = None
) -> Result:
    causes = {"solved": sum(score == 20.0 for score in scores), "slipped": sum(score < 20.0 for score in scores)}
    split = {"digest": digest, "scores": scores, "failed": failed, "causes": causes, "closing_lag": lag}
    return results.result(method, seed, splits={"test": split})


def test_a_row_is_the_mean_over_seeds_and_settings():
    rows = standings.table([result("bc", 0, [20, 0, 10, 20]), result("bc", 1, [20, 20, 0, 20], failed=1)])
    row = rows.iloc[0]
    assert (row["return"], row["success"], row["seeds"], row["episodes"], row["failed"]) == (13.75, 0.625, 2, 8, 1)
    assert row["return_low"] < 13.75 < row["return_high"]


def test_the_best_row_is_first_and_each_version_of_a_split_is_separate():
    rows = standings.table([result("a", 0, [0.0]), result("b", 0, [20.0]), result("a", 0, [5.0], digest="b" * 64)])
    assert rows["method"].tolist() == ["b", "a", "a"]
    assert rows["version"].tolist() == ["aaaaaaaa", "bbbbbbbb", "aaaaaaaa"]


def test_a_higher_score_that_is_not_20_is_no_success():
    assert standings.table([result("a", 0, [19.0, 20.0])]).iloc[0]["success"] == 0.5


def test_endings_are_summed_over_seeds_and_lags_averaged_over_seeds_that_have_one():
    scores = [result("a", 0, [20.0, 3.0], lag=0.1), result("a", 1, [1.0, 2.0], lag=0.3), result("a", 2, [0.0, 0.0])]
    row = standings.table(scores).iloc[0]
    assert (row["solved"], row["slipped"], row["too late"]) == (1, 5, 0)
    assert row["closing_lag"] == 0.2


def test_no_results_make_an_empty_table():
    assert standings.table([]).empty


def noisy(method: str, lead: float, seed: int = 0, reaches: str = "real", digest: str = "a" * 64) -> Result:
    """Invented integer scores of 50 rows around 10 + lead, with little noise."""
    scores = 10.0 + lead + np.random.default_rng([seed, *method.encode()]).integers(-2, 3, 50)
    return replace(result(method, seed, scores.clip(0.0, 20.0).tolist(), digest), reaches=reaches)


def column(played: list[Result], name: str) -> dict:
    return standings.table(played).set_index("method")[name].to_dict()


def test_regret_is_the_lead_of_exp():
    regrets = column(
        [result("exp", 0, [20.0, 12.0]), result("a", 0, [10.0, 2.0]), result("a", 1, [20.0, 4.0])], "regret"
    )
    assert regrets == {"exp": 0.0, "a": 7.0}


def test_without_exp_there_is_no_regret():
    assert standings.table([result("a", 0, [20.0])])["regret"].isna().all()


def test_a_new_method_changes_no_other_interval():
    alone = [noisy("a", 1.0, seed) for seed in range(3)]
    rows = standings.table([*(noisy("b", 5.0, seed) for seed in range(3)), *alone])
    assert rows["method"].tolist() == ["b", "a"]
    pd.testing.assert_frame_equal(rows[rows["method"] == "a"].reset_index(drop=True), standings.table(alone))


def test_the_interquartile_mean_of_a_shipped_split_is_taken_over_its_regions():
    """Of sixteen regions the eight nearest to -x score 20, and the others 0; four are dropped at each end."""
    split = load_split("real", "test")
    near = strata.strata(split)["angle"] <= 1
    played = result("a", 0, np.where(near, 20.0, 0.0).tolist(), split.digest)
    row = standings.table([played]).iloc[0]
    assert row["iqm"] == 10.0  # Four of the middle eight regions score 20.
    assert np.isnan(standings.table([result("a", 0, [20.0])]).iloc[0]["iqm"])


def test_results_of_unequal_length_are_refused():
    with pytest.raises(BadInput, match="test of real, version aaaaaaaa, have different numbers of rows: 1, 2"):
        standings.table([result("a", 0, [1.0]), result("b", 0, [1.0, 2.0])])


def test_results_with_fewer_rows_than_the_shipped_split_are_refused():
    with pytest.raises(BadInput, match="have different numbers of rows: 2, 500"):
        standings.table([result("a", 0, [1.0, 2.0], load_split("real", "test").digest)])


def test_the_ceiling_has_no_rank_and_no_method_has_one_on_minjerk_reaches():
    assert standings.is_ranked("bc", "real")
    assert not standings.is_ranked("exp", "real")
    assert not standings.is_ranked("sim", "minjerk")
