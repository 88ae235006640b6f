"""`hard` has narrow windows on the reaches of `train`, and one rule solves at most half of its rows."""

import numpy as np
import pandas as pd
import pytest

from dextron_bench.reaches.reach import Path
from dextron_bench.splits import hard
from dextron_bench.splits.near_equal import SETTING
from dextron_bench.splits.scanning import Scanner
from tests.helpers.short_reaches import SOURCE

NAMES = SOURCE.names
COUNT = 40


class MadeUp(Scanner):
    """Plays nothing: windows and the successes of the rule follow from a setting's offsets.

    A window is as wide as 2.5 times |offset_x|, from 0 to 0.15, around d_c = 0.3. The rule solves a setting if
    offset_y is above -0.03, which is true for three quarters of them.
    """

    def play(self, rows: pd.DataFrame, criticals: np.ndarray) -> np.ndarray:
        offset_x, offset_y = (rows[name].to_numpy()[:, None] for name in ("offset_x", "offset_y"))
        solved = np.abs(criticals - 0.3) < 1.25 * np.abs(offset_x)
        if (rows["gain"] == hard.FULL_SPEED).all():
            solved = np.broadcast_to(offset_y > -0.03, criticals.shape)
        return np.where(solved, 20.0, 0.0)


@pytest.fixture(scope="module")
def scanner() -> Scanner:
    return MadeUp(SOURCE, None)  # type: ignore[arg-type]


TRAIN = pd.DataFrame([[NAMES[0], 0.0, 0.0, 0.0]] * 3, columns=SETTING)


@pytest.fixture(scope="module")
def rows(scanner) -> pd.DataFrame:
    return hard.draw(scanner, TRAIN, TRAIN.head(0), 0.065, 0, COUNT, coarse=16, fine=64)


def test_windows_are_narrow_and_the_expert_is_in_their_middle(rows):
    assert len(rows) == COUNT
    assert rows["window"].between(0.89 / 64, 0.08).all()
    np.testing.assert_allclose(rows["window"], 2.5 * rows["offset_x"].abs(), atol=0.89 / 64)
    np.testing.assert_allclose(rows["critical"], 0.3, atol=0.89 / 64)


def test_the_rule_solves_half_and_no_more(rows):
    """It solves three quarters of the draws, so the limit of a half is reached."""
    assert (rows["offset_y"] > -0.03).sum() == COUNT // 2


def test_reaches_are_drawn_as_often_as_they_occur_in_train(scanner):
    train = TRAIN.assign(reach=[NAMES[0], NAMES[-1], NAMES[-1]])
    drawn = hard.draw(scanner, train, TRAIN.head(0), 0.065, 0, COUNT, coarse=16, fine=64)
    assert set(drawn["reach"]) == {NAMES[0], NAMES[-1]}


def test_equal_seeds_draw_equal_rows_and_near_equal_settings_are_left_out(scanner, rows):
    again = hard.draw(scanner, TRAIN, rows.head(1), 0.065, 0, COUNT, coarse=16, fine=64)
    assert set(rows["offset_x"][1:]) < set(again["offset_x"])
    assert rows["offset_x"][0] not in set(again["offset_x"])


def test_the_best_distance_has_most_successes(monkeypatch, scanner):
    """Of three rows, distances of 0.05 and 0.055 m solve one, 0.06 m two, the others none."""
    scores = np.zeros((3, 11))
    scores[0, :3] = scores[1, 2] = 20.0
    monkeypatch.setattr(hard, "rule_scores", lambda scanner, rows, distances: scores)
    assert hard.best_distance(scanner, TRAIN) == pytest.approx(0.06)


def test_the_rule_closes_at_its_distance_whatever_the_reach():
    """The palm's centre is 0.105 m ahead of the carrier: 0.4 - 0.105 = 0.295 m from the bottle's axis."""
    path = Path(np.array([[0.0, -0.4, 0.1]]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    assert hard.first_distance(path) == pytest.approx(0.295)
