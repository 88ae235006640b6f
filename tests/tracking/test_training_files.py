"""Values and evaluations are read once each, while their files grow and when a resumed training cuts them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dextron_bench.errors import BadInput
from dextron_bench.tracking.training_files import TrainingFiles, training_folders
from tests.helpers.tiny_training import SEEDS
from tests.helpers.tracked_training import FOLDER, trained


def test_a_point_has_metrics_rates_and_memory(tmp_path: Path):
    rows = [{"epoch": n, "seed": 0, "frames": 20.0 * n, "loss": 0.5} for n in (1, 2)]
    times = [{"what": "epoch", "epoch": n, "seconds": 4.0, "device": "cpu", "memory": 300.0} for n in (1, 2)]
    (tmp_path / "metrics.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (tmp_path / "timing.jsonl").write_text("".join(json.dumps(row) + "\n" for row in times))
    first, second = TrainingFiles(tmp_path, [0]).points()
    assert (second.epoch, second.seed, second.step) == (2, 0, 40)
    assert first.values == {
        **{"train/frames": 20.0, "train/loss": 0.5, "time/seconds_per_epoch": 4.0},
        **{"time/steps_per_second": 5.0, "memory/process_MB": 300.0},
    }
    assert second.values["time/steps_per_second"] == 5.0  # 20 of the 40 steps are of this epoch.


def test_lines_are_read_once_and_only_when_they_are_whole(tmp_path: Path):
    """A resumed training cuts what is after its checkpoint and writes the same rows again."""
    lines = [json.dumps({"epoch": n, "seed": 0}) + "\n" for n in (1, 2, 3, 4)]
    file, files = tmp_path / "metrics.jsonl", TrainingFiles(tmp_path, [0])
    assert files.points() == []
    read = []
    for content in ("".join(lines[:3]), "".join(lines[:3]) + lines[3][:5], "".join(lines[:2]), "".join(lines)):
        file.write_text(content)
        read.append([point.epoch for point in files.points()])
    assert read == [[1, 2, 3], [], [], [4]]


def test_an_epoch_without_frames_counts_as_1000_steps(tmp_path: Path):
    (tmp_path / "metrics.jsonl").write_text('{"epoch": 1, "seed": 0}\n{"epoch": 2, "seed": 0}\n')
    assert [point.step for point in TrainingFiles(tmp_path, [0]).points()] == [1000, 2000]


def test_evaluations_are_points_of_the_learning_curve_with_actions(tmp_path: Path):
    files = trained(tmp_path)
    files.points()
    evaluations = files.evaluations()
    assert [(one.point.epoch, one.point.seed) for one in evaluations] == [(n, k) for n in (2, 4, 5) for k in SEEDS]
    first = evaluations[0]
    score = first.point.values["val/return"]
    assert (first.point.step, first.point.values["val/success"]) == (40, float(score == 20.0))
    assert [list(actions) for actions in first.actions] == [[score / 20] * 3]
    assert files.evaluations() == []
    assert files.is_over


def test_a_damaged_evaluation_is_left_out_and_one_without_actions_is_none(tmp_path: Path):
    trained(tmp_path)
    files = sorted((tmp_path / FOLDER / "weights").rglob("seed*-val*.json"))
    files[0].write_text("{")
    content = json.loads(files[1].read_text())
    del content["actions"]
    files[1].write_text(json.dumps(content))
    evaluations = TrainingFiles(tmp_path / FOLDER, SEEDS).evaluations()
    assert [len(one.actions) for one in evaluations] == [0, 1, 1, 1, 1]


@pytest.mark.parametrize(
    "place",
    ["", "runs", "runs/toy-0.1", "runs/toy-0.1/synthetic", "runs/toy-0.1/synthetic/seed3", FOLDER],
)
def test_a_training_is_known_by_any_folder_around_it(tmp_path: Path, place: str):
    for name in ("training-0+3", "training-1"):
        (tmp_path / f"runs/toy-0.1/synthetic/{name}").mkdir(parents=True)
    (tmp_path / "runs/toy-0.1/synthetic/seed3").mkdir()
    if not place:
        with pytest.raises(BadInput, match="holds no training; give a folder in which"):
            training_folders(tmp_path / "none")
        return
    folders = training_folders(tmp_path / place)
    assert folders[(tmp_path / FOLDER).resolve()] == SEEDS
    assert len(folders) == (1 if place.endswith("3") else 2)
