"""`hard` has narrow windows on the reaches of `train`, and one rule solves at most half of its rows."""

import numpy as np
import pandas as pd
import pytest

from dextron_bench.reaches.reach import Trajectory
from dextron_bench.splits import hard
from dextron_bench.splits.near_equal import SETTING, without_near_equal
from dextron_bench.splits.scanning import Scanner, grid
from tests.helpers.short_reaches import SOURCE

NAMES = SOURCE.names
COUNT = 40


class MadeUp(Scanner):
    """Plays nothing: windows and the successes of the rule follow from a setting's offsets.

    A window is as wide as 2.5 times |offset_x| around d_c = 0.3. The rule solves a setting if offset_y is above 0.
    """

    def play(self, rows: pd.DataFrame, criticals: np.ndarray) -> np.ndarray:
        offset_x, offset_y = (rows[name].to_numpy()[:, None] for name in ("offset_x", "offset_y"))
        solved = np.abs(criticals - 0.3) < 1.25 * np.abs(offset_x)
        if (rows["gain"] == hard.FULL_SPEED).all():
            solved = np.broadcast_to(offset_y > 0.0, criticals.shape)
        return np.where(solved, 20.0, 0.0)


@pytest.fixture(scope="module")
def scanner() -> Scanner:
    return MadeUp(SOURCE, None)  # type: ignore[arg-type]


TRAIN = pd.DataFrame([[NAMES[0], 0.03, -0.005, 0.3], [NAMES[0], 0.03, 0.03, 0.7]], columns=SETTING).assign(gain=1.2)


@pytest.fixture(scope="module")
def rows(scanner) -> pd.DataFrame:
    return hard.HardSettings(scanner, TRAIN, TRAIN.head(0), 0.065, coarse=16, fine=64).draw(COUNT, seed=0)


def test_windows_are_narrow_and_the_expert_is_in_their_middle(rows):
    assert len(rows) == COUNT
    assert rows["window"].between(0.89 / 64, 0.08).all()
    np.testing.assert_allclose(rows["window"], 2.5 * rows["offset_x"].abs(), atol=0.89 / 64)
    np.testing.assert_allclose(rows["critical"], 0.3, atol=0.89 / 64)


def test_a_setting_that_only_the_coarse_scan_solves_has_no_window_and_is_left_out():
    """A point of 16 lies between two points of 64. Here it alone is solved if offset_y is below -0.005."""
    point = grid(16)[3]

    class Slit(MadeUp):
        def play(self, rows: pd.DataFrame, criticals: np.ndarray) -> np.ndarray:
            slit = (rows["offset_y"] < -0.005).to_numpy()[:, None] & (rows["gain"] != hard.FULL_SPEED).all()
            return np.where(slit, 20.0 * (np.abs(criticals - point) < 1e-6), super().play(rows, criticals))

    scanner = Slit(SOURCE, None)  # type: ignore[arg-type]
    drawn = hard.HardSettings(scanner, TRAIN, TRAIN.head(0), 0.065, coarse=16, fine=64).draw(COUNT, seed=0)
    assert (drawn["window"] > 0.0).all()
    assert (drawn["offset_y"] >= -0.005).all()


def test_rows_lie_near_settings_of_train_that_the_rule_fails(rows):
    """It fails the first of the two settings only."""
    assert (rows["duration_noise"] == 0.3).all()
    assert rows["offset_x"].between(0.02, 0.04).all()
    assert rows["offset_y"].between(-0.015, 0.005).all()
    assert rows["gain"].nunique() == COUNT


def test_the_rule_solves_a_share_and_no_more(scanner, monkeypatch):
    """Near this setting it solves half of the draws, so a limit of a quarter is reached."""
    monkeypatch.setattr(hard, "RULE_SHARE", 0.25)
    train = TRAIN.head(1).assign(offset_y=0.0)
    drawn = hard.HardSettings(scanner, train, train.head(0), 0.065, coarse=16, fine=64).draw(COUNT, seed=0)
    assert (drawn["offset_y"] > 0.0).sum() == COUNT // 4


def test_what_the_rule_solves_is_not_scanned_once_its_share_is_full(monkeypatch):
    """Without a share, only settings that the rule fails are scanned."""
    scanned = []

    class Noting(MadeUp):
        def scan(self, rows: pd.DataFrame, points: int) -> np.ndarray:
            scanned.append(rows["offset_y"].max())
            return super().scan(rows, points)

    monkeypatch.setattr(hard, "RULE_SHARE", 0.0)
    noting = Noting(SOURCE, None)  # type: ignore[arg-type]
    drawn = hard.HardSettings(noting, TRAIN, TRAIN.head(0), 0.065, coarse=16, fine=64).draw(COUNT, seed=0)
    assert len(drawn) == COUNT
    assert max(scanned) <= 0.0


def test_offsets_stay_within_the_range_of_all_settings(scanner):
    train = TRAIN.head(1).assign(offset_y=-0.059)
    drawn = hard.HardSettings(scanner, train, train.head(0), 0.065, coarse=16, fine=64).draw(COUNT, seed=0)
    assert drawn["offset_y"].min() == -0.06


def test_equal_seeds_draw_equal_rows_and_near_equal_settings_are_left_out(scanner, rows):
    again = hard.HardSettings(scanner, TRAIN, rows.head(1), 0.065, coarse=16, fine=64).draw(COUNT, seed=0)
    assert len(without_near_equal(again, rows.head(1))) == COUNT
    distant = without_near_equal(rows, rows.head(1))
    assert set(distant["offset_x"]) < set(again["offset_x"])


def test_the_best_distance_has_most_successes(monkeypatch, scanner):
    """Of three rows, distances of 0.05 and 0.055 m solve one, 0.06 m two, the others none."""
    scores = np.zeros((3, 11))
    scores[0, :3] = scores[1, 2] = 20.0
    monkeypatch.setattr(hard, "rule_scores", lambda scanner, rows, distances: scores)
    assert hard.best_distance(scanner, TRAIN) == pytest.approx(0.06)


def test_the_rule_closes_at_its_distance_whatever_the_reach():
    """The palm's centre is 0.105 m ahead of the carrier: 0.4 - 0.105 = 0.295 m from the bottle's axis."""
    path = Trajectory(np.array([[0.0, -0.4, 0.1]]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    assert hard.first_distance(path) == pytest.approx(0.295)
