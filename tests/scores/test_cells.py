"""Cells of the leaderboard as text."""

from __future__ import annotations

import math
from typing import Any

from dextron_bench.scores import cells

ROW: dict[str, Any] = {
    **{"rank": 3.0, "return": 17.956, "return_low": 17.39, "return_high": 18.484},
    **{"success": 0.8826, "success_low": 0.85, "success_high": 0.909, "iqm": 18.0, "regret": 2.044},
    **{"episodes": 300, "closing_lag": -0.004, "solved": 265, "slipped": 35},
}


def test_a_score_is_its_mean_with_its_interval():
    assert str(cells.mean_return(ROW)) == "17.96 [17.39, 18.48]"
    assert str(cells.success(ROW)) == "88.3 [85.0, 90.9]"
    assert (cells.rank(ROW), cells.regret(ROW), cells.closing_lag(ROW)) == ("3", "2.04", "-0.00")


def test_one_has_no_plural():
    assert [cells.counted(number, "seed") for number in (0, 1, 3)] == ["0 seeds", "1 seed", "3 seeds"]


def test_an_unknown_interval_is_left_out():
    assert str(cells.interquartile_mean(ROW)) == "18.00"


def test_an_unknown_value_is_an_empty_cell():
    row = {"rank": math.nan, "regret": math.nan, "closing_lag": None}
    assert [cells.rank(row), cells.regret(row), cells.closing_lag(row), str(cells.mean_return(row))] == [""] * 4


def test_shares_are_percentages_of_all_episodes():
    row = ROW | dict.fromkeys(set(cells.CAUSES) - ROW.keys(), 0)
    assert sorted(cells.cause_shares(row), key=float)[-2:] == ["11.7", "88.3"]


def test_very_small_p_values_look_alike():
    assert [cells.p_value(p) for p in (1.0, 0.04567, 3e-9, 9e-11, 0.0)] == ["1", "0.046", "3e-09", "<1e-10", "<1e-10"]
