"""A trial of a sweep: settings of the method, the run that has them, and its scores on `val`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from dextron_bench.scores.statistics import Estimate

STARTED, DONE, STOPPED, FAILED = "started", "done", "stopped early", "failed"
ENDED = (DONE, STOPPED)  # States that a sweep leaves as they are; a failed trial is tried again.


@dataclass(frozen=True, slots=True)
class Trial:
    """One trial; `settings` are the varied ones alone, and `run` is the name of its run, such as "mine-near0.1/real".

    `returns` and `successes` are the mean return and the success rate on `val`, over all seeds. `points` are the mean
    returns of the learning curve by epoch. `failed` is the number of episodes in which the agent raised an error, and
    `error` the line of a trial that failed.
    """

    settings: Mapping[str, Any]
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

    def as_json(self) -> dict[str, Any]:
        """The trial as plain values."""
        estimates = {"return": self.returns, "success": self.successes}
        return {
            **{"settings": dict(self.settings), "run": self.run, "state": self.state, "error": self.error},
            "val": {name: asdict(value) for name, value in estimates.items() if value} | {"failed": self.failed},
            "points": [{"epoch": epoch, "return": value} for epoch, value in sorted(self.points.items())],
        }

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Trial:
        """The trial that `as_json` wrote."""
        val = content["val"]
        returns, successes = (Estimate(**val[name]) if name in val else None for name in ("return", "success"))
        points = {point["epoch"]: point["return"] for point in content["points"]}
        about = {name: content[name] for name in ("settings", "run", "state", "error")}
        return cls(**about, returns=returns, successes=successes, failed=val["failed"], points=points)


def best(trials: Sequence[Trial]) -> int | None:
    """The number of the trial with the highest mean return on `val`, the first of equals; None if none is done."""
    done = [number for number, trial in enumerate(trials) if trial.state == DONE]
    return max(done, key=lambda number: trials[number].score) if done else None
