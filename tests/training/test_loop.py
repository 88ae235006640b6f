"""The training loop: a training killed at any write ends with the same bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dextron_bench.errors import Failed
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.storage import atomic, tensors
from dextron_bench.training import learning_curve, loop, metric_rows
from dextron_bench.training.checkpoints import Checkpoints
from tests.helpers import tiny_training
from tests.helpers.tiny_training import QUICK, SEEDS, Killed, train
from tests.helpers.toy_learner import Toy, ToyTrainer


def test_the_toy_is_a_learner():
    assert isinstance(QUICK, Learner)
    assert not isinstance(QUICK, PolicyTransfer)


def test_a_training_writes_metrics_and_snapshots_and_reports_epochs(tmp_path: Path):
    reports = []
    checkpoints = train(tmp_path / "a", report=lambda *parts: reports.append(parts))
    assert checkpoints.epochs() == [2, 4, 5]
    assert [(row.epoch, row.seed) for row in checkpoints.metrics()] == [(e, s) for e in range(1, 6) for s in SEEDS]
    about = tensors.read_about(checkpoints.snapshot(4, 3))
    assert (about["label"], about["seed"], about["seeds"], about["epoch"], about["frames"]) == (
        "toy-0.1", 3, [0, 3], 4, 80.0,
    )  # fmt: skip
    assert not (tmp_path / "a" / "journals").exists()
    assert [report[:2] for report in reports] == [(n, 5) for n in (0, 1, 2, 2, 3, 4, 4, 5, 5, 5, 5)]
    assert reports[0][2] == ""
    assert reports[-3][2].startswith("val ")
    assert [report[2] for report in reports[-2:]] == [f"choosing between the 5 best of seed {seed}" for seed in SEEDS]


def test_a_finished_training_computes_nothing_and_changes_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    train(tmp_path / "a")
    before = tiny_training.contents(tmp_path / "a")
    for name in ("__init__", "advance"):
        monkeypatch.setattr(ToyTrainer, name, None)
    monkeypatch.setattr(learning_curve, "rollout", None)
    train(tmp_path / "a")
    assert tiny_training.contents(tmp_path / "a") == before


def test_a_training_that_a_watch_stopped_continues_with_the_same_bytes(tmp_path: Path):
    epochs: list[list[int]] = []

    def watch(curves: dict[int, list[learning_curve.CurvePoint]]) -> None:
        assert list(curves) == list(SEEDS)
        epochs.append([point.epoch for point in curves[SEEDS[-1]]])
        if len(epochs) == 2:
            raise loop.StoppedEarly

    with pytest.raises(loop.StoppedEarly):
        train(tmp_path / "a", watch=watch)
    progress = Checkpoints(tmp_path / "a", SEEDS).progress()
    assert progress is not None
    assert progress.epoch == 4
    train(tmp_path / "a", watch=watch)
    assert epochs == [[2], [2, 4], [2, 4]]  # The last one when it continues, and none at its end.
    train(tmp_path / "unbroken")
    assert tiny_training.contents(tmp_path / "a") == tiny_training.contents(tmp_path / "unbroken")


def test_a_training_killed_before_or_after_any_write_ends_with_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    train(tmp_path / "unbroken")
    unbroken = tiny_training.contents(tmp_path / "unbroken")
    write_file = atomic._write
    writes = 0
    for writes in range(1000):
        folder, left = tmp_path / f"killed{writes}", [writes]

        def killed(file: Path, write: Any, put: Any, left: list[int] = left) -> None:
            left[0] -= 2
            if left[0] == -2:  # An even number: before the write, with a half-written file left behind.
                file.parent.mkdir(parents=True, exist_ok=True)
                file.with_name(f".{file.name}.1.part").write_bytes(b"half")
                raise Killed
            write_file(file, write, put)
            if left[0] == -1:
                raise Killed

        with monkeypatch.context() as patched:
            patched.setattr(atomic, "_write", killed)
            try:
                train(folder)
                break
            except Killed:
                pass
        progress = Checkpoints(folder, SEEDS).progress()
        if (folder / "metrics.jsonl").exists() and not (progress and progress.over):
            with (folder / "metrics.jsonl").open("a") as file:
                file.write('{"epoch": 5, "lo')
        train(folder)
        assert tiny_training.contents(folder) == unbroken, writes
    assert writes == 2 * (3 + 3 * 6)  # Three files at the start, six in each period.


def test_a_training_killed_after_the_metrics_of_any_epoch_ends_with_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Rows after the last checkpoint are cut when the training is resumed, and written again."""
    train(tmp_path / "unbroken")
    unbroken = tiny_training.contents(tmp_path / "unbroken")
    append = metric_rows.append
    for last in range(1, 6):
        folder = tmp_path / f"killed{last}"

        def killed(place: Path, rows: Any, last: int = last) -> None:
            append(place, rows)
            if rows[0].epoch == last:
                raise Killed

        with monkeypatch.context() as patched:
            patched.setattr(metric_rows, "append", killed)
            with pytest.raises(Killed):
                train(folder)
        assert len(metric_rows.read(folder)) == 2 * last  # Before any checkpoint of this epoch.
        progress = Checkpoints(folder, SEEDS).progress()
        assert (progress.epoch if progress else 0) == {1: 0, 2: 0, 3: 2, 4: 2, 5: 4}[last]
        train(folder)
        assert tiny_training.contents(folder) == unbroken, last


def test_a_training_depends_on_journal_and_streams(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The test above relies on this: it fails if the journal or the random state is lost."""
    trainer = ToyTrainer(QUICK, 2, SEEDS)
    for _ in range(2):
        trainer.advance()
    journal, state = trainer.journal(), trainer.state()
    losses = trainer.advance()
    for changed_journal in ({"experience": journal["experience"][:, ::-1]}, None):
        resumed = ToyTrainer(QUICK, 2, SEEDS)
        copy = {name: array.copy() for name, array in state.items()}
        if changed_journal is None:
            copy["streams"][:, 1] += 1
        resumed.restore(copy, [changed_journal or journal])
        assert resumed.advance() != losses


def test_a_divergence_names_the_last_good_checkpoint(tmp_path: Path):
    for _ in range(2):
        with pytest.raises(Failed) as caught:
            train(tmp_path / "a", Toy(preset="quick", spoils=5))
        assert str(caught.value) == (
            "training of 'toy-0.1' diverged: 'loss' of seed 3 is nan in epoch 5; the last good checkpoint is at "
            f"epoch 4 in {tmp_path / 'a'}"
        )
    with pytest.raises(Failed, match="in epoch 1; there is no checkpoint yet"):
        train(tmp_path / "b", Toy(preset="quick", spoils=1))


def test_a_trainer_that_raises_or_returns_too_little_is_an_agent_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(AgentError, match=r"epoch 3 of method 'toy-0\.1' raised ZeroDivisionError: toys break"):
        train(tmp_path / "a", Toy(preset="quick", breaks=3))
    monkeypatch.setattr(ToyTrainer, "advance", lambda self: [])
    with pytest.raises(AgentError, match="for each of 2 seeds; it went from epoch 0 to 0 with 0"):
        train(tmp_path / "b")
    monkeypatch.setattr(ToyTrainer, "advance", lambda self: None)
    with pytest.raises(AgentError, match="for each of 2 seeds; it went from epoch 0 to 0 with None"):
        train(tmp_path / "d")
    monkeypatch.undo()
    monkeypatch.setattr(ToyTrainer, "weights", lambda self: [{}])
    with pytest.raises(AgentError, match="one for each of 2 seeds, not 1"):
        train(tmp_path / "e")
    monkeypatch.setattr(ToyTrainer, "state", lambda self: 1 / 0)
    with pytest.raises(AgentError, match=r"state\(\) of the trainer raised ZeroDivisionError"):
        train(tmp_path / "f")
    with pytest.raises(AgentError, match="a period of at least one; it has 5 and 0"):
        train(tmp_path / "c", Toy(preset="quick", every=0))
