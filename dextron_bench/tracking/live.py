"""Follows trainings in Rerun's viewer, from their files: while they run, or afterwards."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from dextron_bench.recording.training_view import open_training_viewer
from dextron_bench.tracking.follower import POLL, Counts, Follower
from dextron_bench.tracking.to_rerun import RerunTracker
from dextron_bench.tracking.training_files import TrainingFiles

PENDING = 1000  # Evaluations whose episodes wait; Rerun needs milliseconds for each.


def watch(
    trainings: Sequence[TrainingFiles],
    is_over: Callable[[], bool],
    note: Callable[[Counts], None] = lambda counts: None,
) -> Counts:
    """Shows trainings in one window until the user closes it; returns the counts of all. Raises ViewerError.

    `note` receives the counts when something new is shown; they are over as soon as the trainings are, and all is
    shown.
    """
    with open_training_viewer() as (connect, is_open):
        followers = [Follower(files, RerunTracker(files, connect), PENDING) for files in trainings]
        counts = Counts()
        while is_open():
            over = is_over()
            if sum(follower.step() for follower in followers):
                counts = _sum([follower.counts for follower in followers])
                note(counts)
            elif over and not counts.over:
                counts.over = True
                note(counts)
            else:
                time.sleep(POLL)
    if not counts.over:
        counts.error = counts.error or "its window was closed"
        note(counts)
    return counts


def _sum(parts: Sequence[Counts]) -> Counts:
    points, evaluations, dropped = (
        sum(getattr(part, name) for part in parts) for name in ("points", "evaluations", "dropped")
    )
    return Counts(points, evaluations, dropped, next((part.error for part in parts if part.error), ""))
