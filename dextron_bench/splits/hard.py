"""The split `hard`: settings that only a precise closing moment solves, and often not the moment of a simple rule."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dextron_bench.experts import policies
from dextron_bench.reaches import reach, rotation, setting
from dextron_bench.splits.near_equal import SETTING, without_near_equal
from dextron_bench.splits.scanning import RANGE, Scanner, best_critical, success_window
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world import task

WINDOW = 0.08  # Largest window of a row.
RULE_SHARE = 0.5  # Largest share of the rows that the rule of thumb solves.
FULL_SPEED = 1e6  # A gain so large that an expert only opens and closes at full speed.
DISTANCES = np.arange(10, 21) * 0.005  # [m] from the bottle; the rule takes the best.
APART = 0.01  # [m] largest distance, in x and in y, from the offset of the setting near which a row is drawn.
BLOCK = 256  # Settings that are drawn together.


@dataclass(frozen=True, slots=True)
class HardSettings:
    """New settings near settings of `train` that the rule of thumb fails when it closes at `distance` [m].

    No setting is near-equal to one of `train` or `held_out`. A scan of `coarse` points sorts out most draws, and one of
    `fine` points decides. Settings have the duration noise of the setting that they are near, or one that `new_noise`
    draws for a reach.
    """

    scanner: Scanner
    train: pd.DataFrame
    held_out: pd.DataFrame
    distance: float
    coarse: int
    fine: int
    new_noise: Callable[[str, np.random.Generator], float] | None = None

    def draw(self, count: int, seed: int, progress: Progress = no_progress) -> pd.DataFrame:
        """`count` settings with gain, best d_c and window, at most WINDOW; the rule solves at most RULE_SHARE."""
        settings = self.train.drop_duplicates(SETTING)
        failed = settings[~self._rule_solves(settings)]
        hard, left = pd.DataFrame(), int(RULE_SHARE * count)  # `left`: how many more rows may be solved by the rule.
        for number in itertools.count():
            progress(min(len(hard), count), count)
            if len(hard) >= count:
                break
            draws = self._draw_block(failed, np.random.default_rng([seed, number, 5]))
            if not left:  # Then no row that the rule solves is kept: it goes before the scans, which take longer.
                draws = draws[~self._rule_solves(draws)]
            rows = without_near_equal(without_near_equal(self._narrow(draws), self.train), self.held_out)
            solved = self._rule_solves(rows)
            kept = ~solved | (np.cumsum(solved) <= left)
            left -= int((solved & kept).sum())
            hard = pd.concat([hard, rows[kept]], ignore_index=True)
        return hard.head(count)

    def _draw_block(self, settings: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        """BLOCK settings, each near a random one of `settings`: other offsets and a new gain."""
        rows = settings.iloc[rng.integers(len(settings), size=BLOCK)][SETTING].reset_index(drop=True)
        for name in ("offset_x", "offset_y"):
            rows[name] = (rows[name] + rng.uniform(-APART, APART, BLOCK)).clip(-setting.OFFSET, setting.OFFSET)
        rows["gain"] = rng.uniform(*policies.GAIN, BLOCK)
        if self.new_noise is None:
            return rows
        return rows.assign(duration_noise=[self.new_noise(reach, rng) for reach in rows["reach"]])

    def _rule_solves(self, rows: pd.DataFrame) -> np.ndarray:
        return rule_scores(self.scanner, rows, np.array([self.distance]))[:, 0] == task.SUCCESS

    def _narrow(self, draws: pd.DataFrame) -> pd.DataFrame:
        """The draws that have a narrow window, with best d_c and window."""
        points = (self.scanner.scan(draws, self.coarse) == task.SUCCESS).sum(axis=1)
        likely = draws[(points > 0) & (points <= np.ceil(WINDOW / RANGE * self.coarse))]
        scores = self.scanner.scan(likely, self.fine)
        windows = success_window(scores)
        measured = likely.assign(critical=best_critical(scores), window=windows)
        return measured[(windows > 0) & (windows <= WINDOW)]


def best_distance(scanner: Scanner, rows: pd.DataFrame) -> float:
    """The distance of DISTANCES [m] at which the rule of thumb has most successes in `rows`."""
    successes = (rule_scores(scanner, rows, DISTANCES) == task.SUCCESS).sum(axis=0)
    return float(DISTANCES[np.argmax(successes)])


def rule_scores(scanner: Scanner, rows: pd.DataFrame, distances: np.ndarray) -> np.ndarray:
    """Sums of rewards (rows, m) of the rule of thumb, which closes at full speed within a distance (m,) [m]."""
    first = np.array([first_distance(scanner.source.path(case)) for case in setting.from_frame(rows)])
    return scanner.play(rows.assign(gain=FULL_SPEED), distances / first[:, None])


def first_distance(path: reach.Trajectory) -> float:
    """Horizontal distance of the palm's centre from the bottle at the start of a path [m]."""
    centre = path.positions[0] + reach.PALM_AHEAD + rotation.rotate(path.quaternions[0], reach.PALM_CENTRE)
    return float(np.sqrt((centre[:2] ** 2).sum()))
