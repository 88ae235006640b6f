"""Passes what a training writes on to a tracker, and counts what does not arrive.

The files of the training are the queue: the training never waits for a tracker. Only episodes wait in memory, a
bounded number of evaluations, because a film of them may take longer than the next epochs.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.replay import replay
from dextron_bench.reaches.sources import open_source
from dextron_bench.splits.loading import load_split
from dextron_bench.storage import atomic
from dextron_bench.tracking.trackers import Tracker
from dextron_bench.tracking.training_files import Evaluation, TrainingFiles

PENDING = 12  # Evaluations whose episodes wait; the oldest of more is dropped.
SLOW = "it was slower than the training"
POLL = 0.5  # [s] between two looks at the files.


@dataclass(slots=True)
class Counts:
    """What a tracker has shown: points (values of an epoch or evaluation), and evaluations with episodes.

    `dropped` counts both that did not arrive, `error` is the first reason, and `over` says that nothing more comes.
    """

    points: int = 0
    evaluations: int = 0
    dropped: int = 0
    error: str = ""
    over: bool = False

    def write(self, file: Path) -> None:
        """Writes the counts into a file."""
        atomic.write_json(file, asdict(self))


class Follower:
    """Follows one training with one tracker."""

    def __init__(self, files: TrainingFiles, tracker: Tracker, pending: int = PENDING) -> None:
        self.counts = Counts()
        self._files, self._tracker, self._pending = files, tracker, pending
        self._waiting: deque[Evaluation] = deque()

    def step(self) -> bool:
        """Passes on the newest values, and the episodes of one evaluation; False if there was nothing to pass on."""
        points = self._files.points()
        for point in points:
            self.counts.points += self._pass_on(self._tracker.point, point)
        if points:  # The steps of evaluations are known when all epochs are.
            return True
        evaluations = self._files.evaluations()
        for evaluation in evaluations:
            self.counts.points += self._pass_on(self._tracker.point, evaluation.point)
            if evaluation.actions:
                self._waiting.append(evaluation)
        while len(self._waiting) > self._pending:
            self._waiting.popleft()
            self._lose(1)
        if self._waiting:
            self.counts.evaluations += self._pass_on(self._show, self._waiting.popleft())
            return True
        if not evaluations:
            self._pass_on(lambda _: self._tracker.flush(), None)
        return bool(evaluations)

    def run(self, is_over: Callable[[], bool], is_late: Callable[[], bool], note: Callable[[Counts], None]) -> None:
        """Follows until the training `is_over` and all is shown, or it `is_late`; `note` receives the counts."""
        over = False
        while not is_late():
            over = over or is_over()  # Asked before the files are read: what follows is then complete.
            has_news = self.step()
            if has_news:
                note(self.counts)
            elif over:
                break
            else:
                time.sleep(POLL)
        self.close()
        note(self.counts)

    def close(self) -> None:
        """Counts what is left as dropped, and closes the tracker."""
        lost = 0
        while points := self._files.points():
            lost += len(points)
        evaluations = self._files.evaluations()
        lost += len(evaluations) + len(self._waiting) + sum(bool(evaluation.actions) for evaluation in evaluations)
        if lost:
            self._lose(lost)
        self._waiting.clear()
        self._pass_on(lambda _: self._tracker.close(), None)
        self.counts.over = True

    def _show(self, evaluation: Evaluation) -> None:
        episodes = self._episodes(evaluation)
        if episodes:
            self._tracker.episodes(evaluation.point, episodes)

    def _episodes(self, evaluation: Evaluation) -> list[Episode]:
        """The episodes of an evaluation, played again from their actions; none of another version of `val`."""
        val = load_split(self._files.reaches, "val")
        if val.digest != evaluation.digest:
            return []
        rows, source = val.first(len(evaluation.actions)), open_source(self._files.reaches)
        episodes = dict(replay(source, rows, evaluation.actions, threads=1))
        return [episodes[row] for row in range(len(rows)) if len(episodes[row].actions)]

    def _pass_on(self, show: Callable[[Any], None], what: Any) -> bool:
        """Calls the tracker, whose code may raise anything; True if it did not raise."""
        try:
            show(what)
        except Exception as error:
            self._lose(int(what is not None), f"{type(error).__name__}: {' '.join(str(error).split())}")
            return False
        return True

    def _lose(self, count: int, reason: str = SLOW) -> None:
        """Counts what does not arrive."""
        self.counts.dropped += count
        self.counts.error = self.counts.error or reason
