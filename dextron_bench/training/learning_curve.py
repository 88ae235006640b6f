"""The learning curve: how snapshots of a training score on `val`, and which of them is the best.

A score is a pure function of a snapshot's file, and is stored beside it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods.agents import as_agent_error
from dextron_bench.methods.learners import Learner
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, tensors
from dextron_bench.storage.atomic import DamagedFile, read_json
from dextron_bench.training.checkpoints import Checkpoints
from dextron_bench.world import task

CURVE = 50  # Rows of `val` that make a point of the curve.
FINALISTS = 5  # Best snapshots of a curve, which all of `val` decides between.


class Curve:
    """Scores of a training's snapshots on `val`, played where they are not in store."""

    def __init__(self, learner: Learner, done: Checkpoints, source: Source, val: Split, threads: int = 0) -> None:
        self._learner, self._done, self._source, self._val, self._threads = learner, done, source, val, threads

    def extend(self) -> dict[int, float]:
        """Scores the snapshots that have no point yet; returns the last point [mean return] of each seed."""
        last: dict[int, float] = {}
        for epoch in self._done.epochs():
            last = {seed: mean(self._scores(epoch, seed, CURVE)) for seed in self._done.seeds}
        return last

    def points(self, seed: int) -> list[dict[str, Any]]:
        """The curve of a seed: epoch, mean return [0, 20] and share of successes [0, 1]."""
        found = []
        for epoch in self._done.epochs():
            scores = self._scores(epoch, seed, CURVE)
            success = sum(score == task.SUCCESS for score in scores) / len(scores)
            found.append({"epoch": epoch, "return": mean(scores), "success": success})
        return found

    def best(self, seed: int) -> int:
        """The epoch of the snapshot with the highest mean on all of `val`; of equal ones the later."""
        ranked = sorted((mean(self._scores(epoch, seed, CURVE)), epoch) for epoch in self._done.epochs())
        finals = [(mean(self._scores(epoch, seed, len(self._val.cases))), epoch) for _, epoch in ranked[-FINALISTS:]]
        return max(finals)[1]

    def _scores(self, epoch: int, seed: int, rows: int) -> list[float]:
        """Scores on the first rows of `val`."""
        rows = min(rows, len(self._val.cases))
        snapshot = self._done.snapshot(epoch, seed)
        file = snapshot.with_name(f"{snapshot.stem}-val{rows}.json")
        if file.exists() and (found := read_json(file)).get("digest") == self._val.digest:
            return found["scores"]
        scores = self._play(snapshot, rows)
        atomic.write_json(file, {"digest": self._val.digest, "scores": scores})
        return scores

    def _play(self, snapshot: Path, rows: int) -> list[float]:
        try:
            weights = tensors.read(snapshot)
        except (tensors.BadTensors, FileNotFoundError) as error:
            raise DamagedFile(snapshot, error) from error
        with as_agent_error(f"policy() of method {self._learner.name!r}"):
            agent = self._learner.policy(weights)
        cases = self._val.cases[:rows]
        scores = {index: each.score for index, each in rollout(agent, self._source, cases, threads=self._threads)}
        return [scores[index] for index in range(rows)]


def mean(scores: list[float]) -> float:
    """The mean of scores."""
    return sum(scores) / len(scores)
