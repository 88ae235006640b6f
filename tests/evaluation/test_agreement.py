"""Agreement with outcomes on another hand: counted by hand, and through the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.evaluation import agreement
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from tests.helpers.short_reaches import SETTINGS, SOURCE

HEADER = "reach,duration_noise,offset_x,offset_y,gain,critical_distance,return_on_mesh_hand,stratum\n"
ROW = "01_fl_06,0.5,0.01,-0.02,1.2,0.3,20,uniform\n"


def outcomes(returns: list[float], strata: list[str]) -> pd.DataFrame:
    """Outcomes of the first settings of short reaches, each with the same expert."""
    rows = [
        (one.reach, one.duration_noise, one.offset_x, one.offset_y, 1.2, 0.3, score, stratum)
        for one, score, stratum in zip(SETTINGS, returns, strata, strict=False)
    ]
    return pd.DataFrame(rows, columns=HEADER.strip().split(","))


def test_agreement_by_hand():
    """Of three boundary rows, the hands agree on two (a return of 7 fails as 0 does); the uniform row agrees."""
    table = outcomes([20, 7, 20, 0], ["boundary", "boundary", "boundary", "uniform"])
    boundary, uniform, rest = agreement.by_stratum(table, np.array([20.0, 0.0, 19.0, 0.0])).to_dict("records")
    assert boundary == pytest.approx(
        {
            "stratum": "boundary",
            "rows": 3,
            "agreement": 2 / 3,
            "standard_error": (2 / 3 / 3 / 3) ** 0.5,
            "same_return": 1 / 3,
            "theirs": 2 / 3,
            "ours": 1 / 3,
            "only_theirs": 1,
            "only_ours": 0,
        }
    )
    assert (uniform["stratum"], uniform["agreement"]) == ("uniform", 1.0)
    assert rest == {**boundary, "stratum": "all but uniform"}


def test_each_row_is_played_with_its_own_setting_and_expert():
    table = outcomes([0, 0, 0, 0], ["a"] * 4)
    cases = [Case(one, Expert(1.2, 0.3), 0.0) for one in SETTINGS[:4]]
    played = {number: episode.score for number, episode in rollout(ExpertAgent(), SOURCE, cases)}
    assert agreement.play(table, SOURCE).tolist() == [played[number] for number in range(4)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is not a CSV file"),
        (HEADER, "has no rows"),
        ("reach,stratum\na,b\n", "has no column 'duration_noise'"),
        (HEADER + ROW + ROW.replace("1.2", "fast"), "line 3: a value is missing or not a number"),
        (HEADER + ROW.replace(",uniform", ","), "line 2: a value is missing"),
        (HEADER + ROW.replace("0.5", "inf"), "line 2: a value is missing or not a number"),
    ],
)
def test_a_file_that_is_no_table_of_outcomes_gets_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, message: str
):
    file = tmp_path / "outcomes.csv"
    file.write_text(content)
    assert main.main(["data", "agreement", "--with", str(file)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
