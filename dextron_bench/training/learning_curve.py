"""The learning curve: the scores of a training's snapshots on `val`, and the best snapshot.

A score depends only on the snapshot's file and on `val`, and is stored beside the file, with the actions of a few
episodes.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import pandas as pd
from msgspec import Meta, field

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods.agents import as_agent_error
from dextron_bench.methods.learners import Learner
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, hashing, records, tensors
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.records import Count, Record, Return, Scores, Share
from dextron_bench.training.checkpoints import Checkpoints
from dextron_bench.world import task

POINT_ROWS = 50  # Rows of `val` that make a point of the curve.
SHOWN_ROWS = 2  # Rows of `val` whose actions are stored with the scores, so that these episodes can be watched.
FINALISTS = 5  # Snapshots with the best points; their scores on all of `val` decide between them.


Action = Annotated[float, Meta(ge=-1.0, le=1.0)]


class CurvePoint(Record, frozen=True):
    """A point of a learning curve: mean return [0, 20] and share of successes [0, 1] on rows of `val`."""

    epoch: Count
    mean: Return = field(name="return")
    success: Share


class CurveFile(Record, frozen=True):
    """The content of `curve.json`: the learning curve of a seed, on a split."""

    points: list[CurvePoint]
    split: str = ""


class ValScores(Record, frozen=True):
    """The scores of a snapshot on the first rows of `val`, with their hash, and the actions on a few of these."""

    digest: str
    scores: Scores
    sha256: str = ""
    actions: tuple[list[Action], ...] = ()


def read(file: Path) -> list[CurvePoint]:
    """The points of the learning curve in a file; raises DamagedFile."""
    return records.read(file, CurveFile).points


def frame(points: Iterable[CurvePoint]) -> pd.DataFrame:
    """A learning curve as a table with columns epoch, return and success."""
    return pd.DataFrame([{"epoch": point.epoch, "return": point.mean, "success": point.success} for point in points])


class Curve:
    """Scores of a training's snapshots on `val`, played if no file holds them yet."""

    def __init__(
        self, learner: Learner, checkpoints: Checkpoints, source: Source, val: Split, threads: int = 0
    ) -> None:
        self._learner, self._checkpoints, self._source, self._val = learner, checkpoints, source, val
        self._threads = threads
        self._cache: dict[Path, list[float]] = {}  # Scores by file, once read or played.

    def score_snapshots(self) -> None:
        """Plays the episodes of every point that is not scored yet."""
        for epoch in self._checkpoints.epochs():
            for seed in self._checkpoints.seeds:
                self._scores(epoch, seed, POINT_ROWS)

    def last_point(self) -> dict[int, float]:
        """Mean return [0, 20] of each seed at the newest snapshot; empty if there is no snapshot."""
        epochs = self._checkpoints.epochs()
        return {seed: mean(self._scores(epochs[-1], seed, POINT_ROWS)) for seed in self._checkpoints.seeds if epochs}

    def points(self, seed: int) -> list[CurvePoint]:
        """The curve of a seed."""
        points = []
        for epoch in self._checkpoints.epochs():
            scores = self._scores(epoch, seed, POINT_ROWS)
            success = sum(score == task.SUCCESS for score in scores) / len(scores)
            points.append(CurvePoint(epoch, mean(scores), success))
        return points

    def best(self, seed: int) -> int:
        """The epoch of the finalist with the highest mean on all of `val`; the latest if several are equal."""
        ranked = sorted((mean(self._scores(epoch, seed, POINT_ROWS)), epoch) for epoch in self._checkpoints.epochs())
        rows = len(self._val)
        finals = [(mean(self._scores(epoch, seed, rows)), epoch) for _, epoch in ranked[-FINALISTS:]]
        return max(finals)[1]

    def _scores(self, epoch: int, seed: int, rows: int) -> list[float]:
        """Scores on the first rows of `val`."""
        rows = min(rows, len(self._val))
        snapshot = self._checkpoints.snapshot(epoch, seed)
        file = snapshot.with_name(f"{snapshot.stem}-val{rows}.json")
        if file not in self._cache:
            self._cache[file] = self._stored(file, rows) or self._play_and_store(snapshot, file, rows)
        return self._cache[file]

    def _stored(self, file: Path, rows: int) -> list[float]:
        """The scores in a file; empty if there are none on this version of `val`. Raises DamagedFile."""
        content = records.read(file, ValScores) if file.exists() else None
        if content is None or content.digest != self._val.digest:
            return []
        scores = content.scores
        if len(scores) != rows or content.sha256 not in ("", _sha256(scores)):
            raise DamagedFile(file, f"it does not hold the {rows} scores that were written")
        return scores

    def _play_and_store(self, snapshot: Path, file: Path, rows: int) -> list[float]:
        scores, actions = self._play(snapshot, rows)
        atomic.write_json(file, ValScores(self._val.digest, scores, _sha256(scores), tuple(actions)))
        return scores

    def _play(self, snapshot: Path, rows: int) -> tuple[list[float], list[list[float]]]:
        """Scores on the first rows of `val`, and the actions on the first SHOWN_ROWS."""
        try:
            weights = tensors.read(snapshot)
        except tensors.BadTensors as error:
            raise DamagedFile(snapshot, error) from error
        with as_agent_error(f"policy() of method {self._learner.name!r}"):
            agent = self._learner.policy(weights)
        scores, actions = dict[int, float](), dict[int, list[float]]()
        for row, episode in rollout(agent, self._source, self._val.first(rows), threads=self._threads):
            scores[row] = episode.score
            if row < SHOWN_ROWS:
                actions[row] = episode.actions[:, 0].tolist()
        return [scores[row] for row in range(rows)], [actions[row] for row in sorted(actions)]


def _sha256(scores: list[float]) -> str:
    return hashing.digest(*(float(score).hex().encode() for score in scores))


def mean(scores: list[float]) -> float:
    """The mean of scores."""
    return sum(scores) / len(scores)
