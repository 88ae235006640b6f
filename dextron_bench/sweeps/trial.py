"""A trial of a sweep: settings of the method, the run that has them, and its scores on `val`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import msgspec

from dextron_bench.methods.settings import Settings
from dextron_bench.scores.statistics import Estimate
from dextron_bench.storage.records import Count, Record, Return

STARTED, DONE, STOPPED, FAILED = "started", "done", "stopped early", "failed"
ENDED = (DONE, STOPPED)  # States that a sweep leaves as they are; a failed trial is tried again.


class TrialScores(Record, frozen=True):
    """The part of a trial's record about `val`: its estimates, and how many episodes failed."""

    failed: Count
    returns: Estimate | None = msgspec.field(name="return", default=None)
    successes: Estimate | None = msgspec.field(name="success", default=None)


class TrialPoint(Record, frozen=True):
    """The mean return of all seeds at an epoch."""

    epoch: Count
    mean: Return = msgspec.field(name="return")


class TrialRecord(Record, frozen=True):
    """A trial in the file of a sweep."""

    settings: Settings
    run: str
    state: str
    error: str
    val: TrialScores
    points: list[TrialPoint]


@dataclass(frozen=True, slots=True)
class Trial:
    """One trial; `settings` are the varied ones alone, and `run` is the name of its run, such as "mine-near0.1/real".

    `returns` and `successes` are the mean return and the success rate on `val`, over all seeds. `points` are the mean
    returns of the learning curve by epoch. `failed` is the number of episodes in which the agent raised an error, and
    `error` the line of a trial that failed.
    """

    settings: Settings
    run: str = ""
    state: str = STARTED
    returns: Estimate | None = None
    successes: Estimate | None = None
    failed: int = 0
    points: Mapping[int, float] = field(default_factory=dict)
    error: str = ""

    @property
    def score(self) -> float:
        """Mean return on `val`; NaN for a trial that is not done."""
        return self.returns.mean if self.returns else float("nan")

    def as_record(self) -> TrialRecord:
        """The trial as the file of a sweep holds it."""
        points = [TrialPoint(epoch, value) for epoch, value in sorted(self.points.items())]
        scores = TrialScores(self.failed, self.returns, self.successes)
        return TrialRecord(self.settings, self.run, self.state, self.error, scores, points)

    @classmethod
    def of(cls, record: TrialRecord) -> Trial:
        """The trial that a record describes."""
        val, points = record.val, {point.epoch: point.mean for point in record.points}
        scores = val.returns, val.successes, val.failed
        return cls(record.settings, record.run, record.state, *scores, points, record.error)


def best(trials: Sequence[Trial]) -> int | None:
    """The number of the trial with the highest mean return on `val`, the first of equals; None if none is done."""
    done = [number for number, trial in enumerate(trials) if trial.state == DONE]
    return max(done, key=lambda number: trials[number].score) if done else None
