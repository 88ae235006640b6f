"""Training jobs: which seeds still need training, and what a finished training leaves in the folders of runs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.errors import BadInput
from dextron_bench.methods.learners import Trainer, TrainingSetup
from dextron_bench.splits import strata
from dextron_bench.storage import tensors
from dextron_bench.training import jobs
from dextron_bench.training.checkpoints import Checkpoints
from dextron_bench.training.jobs import NoDevice, TrainingJob, UnfinishedTraining
from tests.helpers.tiny_training import QUICK
from tests.helpers.toy_learner import Toy, ToyTrainer


@pytest.fixture
def job(tmp_path: Path) -> TrainingJob:
    """The training of the toy learner on synthetic reaches."""
    return TrainingJob(QUICK, "synthetic", tmp_path / "runs", threads=1)


def test_seeds_train_together_and_finished_seeds_need_no_training(job: TrainingJob):
    assert job.groups([2, 0, 2]) == [(2, 0)]  # Each seed once, in the given order.
    job.run([2, 0])
    assert job.groups([0, 2]) == []
    assert job.groups([0, 1, 2]) == [(1,)]


def test_a_finished_group_publishes_missing_weights_without_training(job: TrainingJob, monkeypatch: pytest.MonkeyPatch):
    job.run([0, 1])
    before = job.run_folder(1).weights.read_bytes()
    job.run_folder(1).weights.unlink()
    assert job.groups([1]) == [(0, 1)]
    monkeypatch.setattr(ToyTrainer, "advance", None)
    job.run([1])
    assert job.run_folder(1).weights.read_bytes() == before


def test_the_best_weights_and_the_curve_are_in_the_folder_of_the_run(job: TrainingJob):
    job.run([0])
    curve = json.loads(job.run_folder(0).curve.read_text())
    assert curve["split"] == "val"
    assert [point["epoch"] for point in curve["points"]] == [2, 4, 5]
    best = max(reversed(curve["points"]), key=lambda point: point["return"])["epoch"]
    about = tensors.read_about(job.run_folder(0).weights)
    facts = {name: about[name] for name in ("label", "reaches", "seed", "best_epoch", "epochs", "frames")}
    assert facts == {
        "label": "toy-0.1", "reaches": "synthetic", "seed": 0, "best_epoch": best, "epochs": 5, "frames": 100,
    }  # fmt: skip
    snapshot = Checkpoints(job.training_folder([0]), [0]).snapshot(best, 0)
    for name, array in tensors.read(snapshot).items():
        assert array.tobytes() == tensors.read(job.run_folder(0).weights)[name].tobytes()
    assert job.seconds(0) is not None
    assert job.seconds(1) is None


def test_a_run_folder_with_other_settings_is_refused_before_training(job: TrainingJob):
    job.run([0])
    other = TrainingJob(Toy(preset="smoke"), "synthetic", job.runs, threads=1)
    with pytest.raises(BadInput, match=r"seed0 holds another run: it differs in settings \(preset\)"):
        other.run([1, 0])
    assert not other.run_folder(1).path.exists()


def test_unfinished_trainings_are_listed_with_the_epochs_left(job: TrainingJob, monkeypatch: pytest.MonkeyPatch):
    advance = ToyTrainer.advance

    def killed(trainer: ToyTrainer) -> list[dict[str, float]]:
        if trainer.epoch == 3:
            raise KeyboardInterrupt
        return advance(trainer)

    with monkeypatch.context() as patched:
        patched.setattr(ToyTrainer, "advance", killed)
        with pytest.raises(KeyboardInterrupt):
            job.run([0, 3])
    assert jobs.unfinished(job.runs) == [
        UnfinishedTraining("toy-0.1", "synthetic", (0, 3), "3 of 5 epochs", is_running=False)
    ]
    job.run([0, 3])
    assert jobs.unfinished(job.runs) == []


def test_a_device_that_the_machine_does_not_have_is_refused(job: TrainingJob, monkeypatch: pytest.MonkeyPatch):
    torch = pytest.importorskip("torch")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert TrainingJob(QUICK, "synthetic", job.runs, device="auto").setup().device == "cpu"
    with pytest.raises(NoDevice, match="this machine has no CUDA device"):
        TrainingJob(QUICK, "synthetic", job.runs, device="cuda").setup()


def test_a_learner_reports_what_it_prepares(job: TrainingJob, monkeypatch: pytest.MonkeyPatch):
    make, reported = Toy.trainer, []

    def prepare(self: Toy, setup: TrainingSetup, seeds: Sequence[int]) -> Trainer:
        setup.report(3, 7, "preparing")
        return make(self, setup, seeds)

    monkeypatch.setattr(Toy, "trainer", prepare)
    job.run([0], lambda done, total, note="": reported.append((done, total, note)))
    assert reported[0] == (3, 7, "preparing")


def test_a_training_without_a_subject_has_other_rows_and_folders_and_the_same_cache(
    job: TrainingJob, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(
        strata, "strata", lambda split: pd.DataFrame({"subject": [case.setting.reach for case in split.cases]})
    )
    without = replace(job, without="a")
    assert {case.setting.reach for case in without.setup().cases} == {"b"}
    assert {case.setting.reach for case in job.setup().cases} == {"a", "b"}
    assert without.run_folder(3).path == job.runs / "without/a/toy-0.1/synthetic/seed3"
    assert without.training_folder([3]).is_relative_to(job.runs / "without/a")
    assert without.setup().cache == job.setup().cache
