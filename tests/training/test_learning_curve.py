"""The learning curve: which snapshot is the best, and which stored scores count."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dextron_bench.splits.loading import Split, load_split
from dextron_bench.storage import atomic
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.training import learning_curve
from dextron_bench.training.checkpoints import Checkpoints
from dextron_bench.training.learning_curve import Curve, CurvePoint
from tests.helpers.short_reaches import SOURCE
from tests.helpers.tiny_training import QUICK, SEEDS, train
from tests.helpers.toy_learner import Toy


def write_scores(checkpoints: Checkpoints, val: Split, epoch: int, scores: list[float]) -> None:
    """Stores the scores of the first rows of `val` for a snapshot of seed 0."""
    file = checkpoints.snapshot(epoch, 0).with_name(f"seed0-val{len(scores)}.json")
    atomic.write_json(file, {"digest": val.digest, "scores": scores})


def test_the_best_snapshot_is_the_latest_of_equal_finalists(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(learning_curve, "FINALISTS", 2)
    monkeypatch.setattr(learning_curve, "POINT_ROWS", 1)
    val = load_split("synthetic", "test")  # It has two rows.
    checkpoints = train(tmp_path / "a", Toy(every=1, preset="quick"), val=val)
    points = {1: 9.0, 2: 4.0, 3: 9.0, 4: 9.0, 5: 8.0}  # The scores of the first row.
    finals = {1: [20.0, 20.0], 3: [9.0, 5.0], 4: [9.0, 5.0]}
    for epoch, point in points.items():
        write_scores(checkpoints, val, epoch, [point])
        write_scores(checkpoints, val, epoch, finals.get(epoch, [0.0, 0.0]))
    assert Curve(QUICK, checkpoints, SOURCE, val).best(0) == 4  # 1 has the best mean, but 3 and 4 are the finalists.
    write_scores(checkpoints, val, 3, [9.0, 6.0])
    curve = Curve(QUICK, checkpoints, SOURCE, val)
    assert curve.best(0) == 3
    assert curve.points(0)[1] == CurvePoint(2, 4.0, 0.0)


def test_the_last_point_is_the_mean_of_the_newest_snapshot(tmp_path: Path):
    val = load_split("synthetic", "val")
    checkpoints = train(tmp_path / "a")
    write_scores(checkpoints, val, 5, [7.0])
    curve = Curve(QUICK, checkpoints, SOURCE, val)
    assert curve.last_point() == {0: 7.0, 3: curve.points(3)[-1].mean}
    assert Curve(QUICK, Checkpoints(tmp_path / "empty", SEEDS), SOURCE, val).last_point() == {}


def test_the_actions_of_the_first_rows_are_stored_and_may_be_missing(tmp_path: Path):
    """Earlier versions stored only scores."""
    checkpoints = train(tmp_path / "a", val=load_split("synthetic", "test"))
    file = checkpoints.snapshot(2, 0).with_name("seed0-val2.json")
    content = json.loads(file.read_text())
    assert content["actions"] == [[score / 20] * 3 for score in content["scores"]]
    del content["actions"]
    file.write_text(json.dumps(content))
    assert Curve(QUICK, checkpoints, SOURCE, load_split("synthetic", "test")).points(0)[0].epoch == 2


def test_scores_on_another_version_of_val_do_not_count(tmp_path: Path):
    checkpoints = train(tmp_path / "a")
    file = checkpoints.snapshot(2, 0).with_name("seed0-val1.json")
    before = file.read_bytes()
    file.write_text(json.dumps({"digest": "old", "scores": [0.0]}))
    train(tmp_path / "a")
    assert file.read_bytes() == before


def test_a_damaged_snapshot_is_named(tmp_path: Path):
    checkpoints = train(tmp_path / "a")
    checkpoints.snapshot(2, 0).write_bytes(b"not weights")
    checkpoints.snapshot(2, 0).with_name("seed0-val1.json").unlink()
    with pytest.raises(DamagedFile, match=r"is damaged \(weights/epoch-0002/seed0\.safetensors has another SHA-256"):
        train(tmp_path / "a")
