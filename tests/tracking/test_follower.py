"""What a tracker does not show is counted, and never ends the follower."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dextron_bench.tracking.follower import Counts, Follower
from dextron_bench.tracking.training_files import Point
from tests.helpers import tracked_training
from tests.helpers.tracked_training import EPOCHS, POINTS, KeepingTracker

VALUES = 2 * (POINTS + len(EPOCHS))  # Two seeds: points of epochs, and points of evaluations.


def follow(base: Path, tracker: KeepingTracker, pending: int = 12, is_late: bool = False) -> Counts:
    follower = Follower(tracked_training.trained(base), tracker, pending)
    follower.run(lambda: True, lambda: is_late, lambda counts: None)
    return follower.counts


def test_all_points_and_episodes_arrive(tmp_path: Path):
    tracker = KeepingTracker()
    assert follow(tmp_path, tracker) == Counts(VALUES, 2 * len(EPOCHS), 0, "", True)
    assert [point.epoch for point in tracker.points if "train/loss" in point.values] == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    point, (episode,) = tracker.shown[-1]
    assert (point.epoch, point.seed) == (5, 3)
    np.testing.assert_array_equal(episode.actions, np.full((3, 1), point.values["val/return"] / 20))
    assert tracker.is_closed


def test_a_tracker_that_fails_loses_only_what_it_refused(tmp_path: Path):
    tracker = KeepingTracker(refused=[3, 4])
    counts = follow(tmp_path, tracker)
    assert (counts.points, counts.dropped, counts.error) == (VALUES - 6, 6, "OSError: no connection")
    assert {point.epoch for point in tracker.points} == {1, 2, 5}


def test_a_full_queue_drops_the_oldest_episodes_and_counts_them(tmp_path: Path):
    tracker = KeepingTracker()
    counts = follow(tmp_path, tracker, pending=2)
    assert [(point.epoch, point.seed) for point, _ in tracker.shown] == [(5, 0), (5, 3)]
    assert (counts.evaluations, counts.dropped, counts.error) == (2, 4, "it was slower than the training")


def test_what_is_left_when_the_time_is_over_is_counted(tmp_path: Path):
    tracker = KeepingTracker()
    counts = follow(tmp_path, tracker, is_late=True)
    assert (counts.points, counts.dropped, counts.over) == (0, VALUES + 2 * len(EPOCHS), True)
    assert tracker.is_closed


def test_an_error_at_the_end_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fail(self: KeepingTracker) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(KeepingTracker, "close", fail)
    counts = follow(tmp_path, KeepingTracker())
    assert (counts.dropped, counts.error, counts.over) == (0, "OSError: disk full", True)


def test_episodes_of_another_version_of_val_are_not_played(tmp_path: Path):
    for file in tracked_training.trained(tmp_path).folder.rglob("*-val*.json"):
        digest = file.read_text()
        file.write_text(digest.replace('"digest": "', '"digest": "0'))
    tracker = KeepingTracker()
    follower = Follower(tracked_training.TrainingFiles(tmp_path / tracked_training.FOLDER, (0, 3)), tracker)
    follower.run(lambda: True, lambda: False, lambda counts: None)
    assert tracker.shown == []
    assert isinstance(tracker.points[0], Point)
