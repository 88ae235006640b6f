"""The result of a run: what an agent scored on splits, and what made it. It is the content of `result.json`."""

from __future__ import annotations

from typing import Annotated

import pandas as pd
from msgspec import UNSET, Meta, UnsetType, field

from dextron_bench.evaluation.declaration import Declaration
from dextron_bench.evaluation.episodes import action_hashes
from dextron_bench.methods.settings import Settings
from dextron_bench.storage.provenance import Provenance
from dextron_bench.storage.records import Amount, Count, Number, Record, Scores


class SplitScores(Record, frozen=True):
    """What an agent scored on a split: the score of every row, and how episodes end.

    `failed` counts the episodes that the agent failed, `causes` the episodes by the cause of their end. `closing_lag`
    is the median in seconds, None if no hand closed. `actions` are hashes, None if they are not known.
    """

    digest: str
    scores: Scores
    failed: Count
    causes: dict[str, Count]
    closing_lag: Number | None
    actions: list[str] | None = None


class Training(Record, frozen=True):
    """The training that made the weights of a run. `frames` is None for a method that does not train in the world."""

    label: str = ""
    reaches: str = ""
    sha256: str = ""
    epochs: Count | None = None
    best_epoch: Count | None = None
    seeds: list[Count] = field(default_factory=list)
    frames: Amount | UnsetType | None = UNSET
    demonstrations: Amount | UnsetType | None = UNSET
    seconds: Amount | UnsetType | None = UNSET

    @property
    def is_in_the_world(self) -> bool:
        """True if it is a training with frames of the world."""
        return self.frames is not None and self.frames is not UNSET


class Code(Record, frozen=True):
    """The class of a method, and the SHA-256 of its file if it is not installed."""

    name: str = field(name="class")
    sha256: str | None


class Maker(Record, frozen=True):
    """The method with its settings; with them the agent can be made again."""

    method: str = ""
    code: Code | None = None
    settings: Settings | None = None


class RunConfig(Maker, frozen=True):
    """The config of a run; `defaults` are the settings that it does not name."""

    reaches: str = ""
    seed: Count | None = None
    defaults: Settings = field(default_factory=dict)
    physics: str = ""


class Replay(Record, frozen=True):
    """How many episodes of a submission were played again, and how many of them were equal bit for bit."""

    episodes: Count
    equal: Count


class Result(Record, frozen=True):
    """One method on one source of reaches with one seed.

    `tier` says how far a row of the board was verified, `privileged` what its agent receives beyond the state.
    `declared` is what the authors of a submission state.
    """

    method: str
    reaches: str
    seed: Count
    splits: Annotated[dict[str, SplitScores], Meta(min_length=1)]
    provenance: Provenance = Provenance()
    tier: str = ""
    privileged: str | None = None
    declared: Declaration | None = None
    training: Training | None = None
    maker: Maker | None = None
    replay: Replay | None = None

    @property
    def about(self) -> dict[str, str | int]:
        """Method, source of reaches and seed, as recordings say them."""
        return {"method": self.method, "reaches": self.reaches, "seed": self.seed}

    @property
    def physics(self) -> str:
        """The hash of the physics with which the episodes were played; empty if it is not known."""
        return self.provenance.physics


def scores_by_split(table: pd.DataFrame) -> dict[str, SplitScores]:
    """What a result says of each split, computed from the rows of its episodes."""
    return {str(name): _scores(rows) for name, rows in table.groupby("split", sort=False)}


def _scores(rows: pd.DataFrame) -> SplitScores:
    actions = rows["actions"] if "actions" in rows else pd.Series([None])
    return SplitScores(
        digest=rows["digest"].iloc[0],
        scores=rows["score"].tolist(),
        failed=int((rows["failure"] != "").sum()),
        causes={str(cause): int(count) for cause, count in rows["cause"].value_counts(sort=False).items()},
        closing_lag=None if rows["closing_lag"].isna().all() else round(float(rows["closing_lag"].median()), 3),
        actions=None if actions.isna().any() else action_hashes(actions),
    )
