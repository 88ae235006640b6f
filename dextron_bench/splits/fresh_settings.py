"""Fresh settings for a row of the board: nobody could know them when the row's agent was made (docs/leaderboard.md)."""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field

import pandas as pd

from dextron_bench.experts import montecarlo
from dextron_bench.reaches import setting
from dextron_bench.splits import fresh
from dextron_bench.splits.loading import Split, cases_from_frame, ranking_splits, split_digest
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.records import Record, Scores
from dextron_bench.world.engine import Engine

EXPERT = ["gain", "critical"]


class FreshSplitScores(Record, frozen=True):
    """The score of every fresh setting of a split."""

    digest: str
    scores: Scores


class FreshScores(Record, frozen=True):
    """What a row scores on fresh settings, by split, and what the settings follow from (see `FreshSettings`)."""

    beacon: str
    submission: str
    splits: dict[str, FreshSplitScores]


@dataclass(frozen=True, slots=True)
class FreshSettings:
    """Which fresh settings a row plays: they follow from the hash of its submission and from a beacon.

    `beacon` is a value that did not exist when the submission was made. `rows` of 0 means as many as each split has.
    """

    submission: str
    beacon: str = field(default_factory=lambda: secrets.token_hex(16))
    rows: int = 0

    def draw(self, reaches: str, threads: int = 0, report: Progress = no_progress) -> list[Split]:
        """The fresh settings of every split that ranks methods; this takes minutes."""
        engine, seed = Engine(montecarlo.SLOTS, threads), fresh.seed_of(self.submission, self.beacon)

        def draw_one(name: str) -> Split:
            def drawing(done: int, total: int, note: str = "") -> None:
                report(done, total, f"drawing fresh settings of {name}")

            return fresh.draw(reaches, name, seed, engine, self.rows, drawing)

        return [draw_one(name) for name in ranking_splits(reaches)]

    def scores(self, table: pd.DataFrame) -> FreshScores:
        """The entry `fresh` of a result, from the table of its episodes on fresh settings."""
        by_split = {
            str(name): FreshSplitScores(rows["digest"].iloc[0], rows["score"].tolist())
            for name, rows in table.sort_values(["split", "row"]).groupby("split", sort=False)
        }
        return FreshScores(self.beacon, self.submission, by_split)


def to_frame(splits: Sequence[Split]) -> pd.DataFrame:
    """A table of fresh settings, from which `from_frame` makes the splits again."""
    return pd.concat([_frame(split) for split in splits], ignore_index=True)


def from_frame(table: pd.DataFrame, reaches: str) -> list[Split]:
    """The fresh splits in a table with the columns of a setting, `split`, `gain` and `critical`."""
    return [
        Split(name=str(name), reaches=reaches, digest=split_digest(rows), cases=tuple(cases_from_frame(rows)))
        for name, rows in table.assign(window=0.0).groupby("split", sort=False)
    ]


def _frame(split: Split) -> pd.DataFrame:
    experts = [(case.expert.gain, case.expert.critical) for case in split.cases]
    frame = setting.to_frame([case.setting for case in split.cases])
    return frame.assign(split=split.name).join(pd.DataFrame(experts, columns=EXPERT))
