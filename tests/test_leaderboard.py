"""Rows computed from scores, with numbers done by hand."""

from dextron_bench import leaderboard


def result(
    method: str, seed: int, scores: list[float], digest: str = "a" * 64, failed: int = 0, lag: float | None = None
) -> dict:
    causes = {"solved": sum(score == 20.0 for score in scores), "slipped": sum(score < 20.0 for score in scores)}
    split = {"digest": digest, "scores": scores, "failed": failed, "causes": causes, "closing_lag": lag}
    return {"method": method, "reaches": "real", "seed": seed, "splits": {"test": split}, "provenance": {}}


def test_a_row_is_the_mean_over_seeds_and_settings():
    rows = leaderboard.table([result("bc", 0, [20, 0, 10, 20]), result("bc", 1, [20, 20, 0, 20], failed=1)])
    row = rows.iloc[0]
    assert (row["return"], row["success"], row["seeds"], row["episodes"], row["failed"]) == (13.75, 0.625, 2, 8, 1)
    assert row["return_low"] < 13.75 < row["return_high"]


def test_best_first_and_versions_of_a_split_apart():
    rows = leaderboard.table([result("a", 0, [0.0]), result("b", 0, [20.0]), result("a", 0, [5.0], digest="b" * 64)])
    assert rows["method"].tolist() == ["b", "a", "a"]
    assert rows["version"].tolist() == ["aaaaaaaa", "bbbbbbbb", "aaaaaaaa"]


def test_a_higher_score_that_is_not_20_is_no_success():
    assert leaderboard.table([result("a", 0, [19.0, 20.0])]).iloc[0]["success"] == 0.5


def test_endings_are_counted_over_seeds_and_lags_averaged_where_a_hand_closed():
    scores = [result("a", 0, [20.0, 3.0], lag=0.1), result("a", 1, [1.0, 2.0], lag=0.3), result("a", 2, [0.0, 0.0])]
    row = leaderboard.table(scores).iloc[0]
    assert (row["solved"], row["slipped"], row["too late"]) == (1, 5, 0)
    assert row["closing_lag"] == 0.2


def test_no_results_make_an_empty_table():
    assert leaderboard.table([]).empty
