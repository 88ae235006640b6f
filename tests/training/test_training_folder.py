"""The folder of a training: what is damaged, lost, foreign or held by another process is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dextron_bench.errors import BadInput
from dextron_bench.methods.agents import AgentError
from dextron_bench.storage import tensors
from dextron_bench.storage.atomic import DamagedFile, IncompleteFolder, OtherForm
from dextron_bench.training import learning_curve, loop
from dextron_bench.training.checkpoints import Busy, Checkpoints
from tests.helpers import tiny_training
from tests.helpers.tiny_training import SEEDS, Killed, train
from tests.helpers.toy_learner import Toy


def half_done(folder: Path) -> Path:
    """The folder of a training that stopped in its fifth epoch."""
    with pytest.raises(AgentError):
        train(folder, Toy(preset="quick", breaks=5))
    return folder


@pytest.mark.parametrize(
    "name", ["checkpoint.safetensors", "journals/000002.safetensors", "metrics.jsonl", "config.json"]
)
def test_a_damaged_file_of_a_training_is_named(tmp_path: Path, name: str):
    folder = half_done(tmp_path / "a")
    file = folder / name
    file.write_bytes(file.read_bytes()[: 20 if name != "checkpoint.safetensors" else -20])
    cut = (
        r"is not complete \(metrics\.jsonl ends before line 8"
        if name == "metrics.jsonl"
        else r"is damaged .*; remove it"
    )
    with pytest.raises(DamagedFile, match=cut) as caught:
        train(folder, Toy(preset="quick", breaks=5))
    assert str(folder) in str(caught.value)


BREAKS = Toy(preset="quick", breaks=5)
BELONGING = ["journals/000002.safetensors", "weights/epoch-0002/seed3.safetensors", "checkpoint.safetensors"]


class CurveThatEnds(learning_curve.Curve):
    """Ends the process after the checkpoint of epoch 4."""

    def last_point(self) -> dict[int, float]:
        if 4 in self._checkpoints.epochs():
            raise Killed
        return super().last_point()


@pytest.mark.parametrize("name", [*BELONGING, "metrics.jsonl"])
def test_a_lost_file_of_an_unfinished_training_is_named(tmp_path: Path, name: str):
    folder = half_done(tmp_path / "a")
    (folder / name).unlink()
    before = tiny_training.contents(folder)
    with pytest.raises(IncompleteFolder, match=r"a is not complete \(.*; if it is a copy, copy it again;") as caught:
        train(folder, BREAKS)
    assert name in str(caught.value)
    assert "remove" not in str(caught.value)
    assert tiny_training.contents(folder) == before


@pytest.mark.parametrize("name", [*BELONGING, "metrics.jsonl"])
def test_a_flipped_bit_in_a_file_of_an_unfinished_training_is_noticed(tmp_path: Path, name: str):
    """Without the list of the checkpoint, most of these bits change the weights and nothing else."""
    folder = half_done(tmp_path / "a")
    content = (folder / name).read_bytes()
    for place in (len(content) // 3, len(content) * 2 // 3, len(content) - 9):
        flipped = bytearray(content)
        flipped[place] ^= 1
        (folder / name).write_bytes(flipped)
        with pytest.raises(DamagedFile, match=r"a is damaged \(.*; remove it and run again"):
            train(folder, BREAKS)


def test_metrics_that_are_cut_in_their_last_counted_line_are_noticed(tmp_path: Path):
    file = half_done(tmp_path / "a") / "metrics.jsonl"
    file.write_bytes(file.read_bytes()[:-9])
    with pytest.raises(DamagedFile, match=r"metrics\.jsonl ends before line 8"):
        train(tmp_path / "a", BREAKS)


def test_a_journal_of_another_training_is_not_used(tmp_path: Path):
    folder = half_done(tmp_path / "a")
    journal = folder / "journals/000002.safetensors"
    journal.with_name("000003.safetensors").write_bytes(journal.read_bytes())
    with pytest.raises(DamagedFile, match=r"journals/000003\.safetensors does not belong to its checkpoint"):
        train(folder, BREAKS)


def test_a_snapshot_that_is_lost_after_the_training_is_noticed(tmp_path: Path):
    checkpoints = train(tmp_path / "a")
    checkpoints.snapshot(4, 0).unlink()
    with pytest.raises(DamagedFile, match=r"weights/epoch-0004/seed0\.safetensors is missing"):
        train(tmp_path / "a")


def test_a_checkpoint_of_an_earlier_version_without_a_list_continues(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    train(tmp_path / "unbroken")
    folder = tmp_path / "a"
    with monkeypatch.context() as patched:
        patched.setattr(loop, "Curve", CurveThatEnds)
        with pytest.raises(Killed):
            train(folder)
    file = folder / "checkpoint.safetensors"
    about = {name: tensors.read_about(file)[name] for name in ("epoch", "epochs", "device")}
    tensors.write(file, tensors.read(file), about)
    train(folder)
    assert tiny_training.contents(folder) == tiny_training.contents(tmp_path / "unbroken")


def test_other_settings_or_another_device_do_not_continue(tmp_path: Path):
    folder = half_done(tmp_path / "a")
    with pytest.raises(BadInput, match="holds another run: it differs in settings"):
        train(folder, Toy(preset="paper"))
    with pytest.raises(BadInput, match="was begun on cpu: continue with --device cpu, or remove it"):
        train(folder, Toy(preset="quick", breaks=5), device="cuda")


def test_two_processes_do_not_train_in_one_folder(tmp_path: Path):
    checkpoints = Checkpoints(tmp_path / "a", SEEDS)
    with checkpoints.locked(), pytest.raises(Busy, match="another process is training in"):
        train(tmp_path / "a")
    train(tmp_path / "a")


@pytest.mark.parametrize("error", [PermissionError(13, "Permission denied"), MemoryError("too little")])
def test_a_journal_that_cannot_be_read_now_is_not_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
):
    """The advice to remove a training follows only from damage."""
    folder, read = half_done(tmp_path / "a"), tensors.read

    def fail(file: Path) -> dict[str, Any]:
        if file.parent.name == "journals":
            raise error
        return read(file)

    monkeypatch.setattr(tensors, "read", fail)
    with pytest.raises(type(error)):
        train(folder, BREAKS)


def test_a_checkpoint_of_another_version_is_not_called_damaged(tmp_path: Path):
    folder = half_done(tmp_path / "a")
    file = folder / "checkpoint.safetensors"
    about = {name: value for name, value in tensors.read_about(file).items() if name != "device"}
    tensors.write(file, tensors.read(file), about)
    with pytest.raises(OtherForm, match=r"required field `device`.*; restore it, or use the version") as caught:
        train(folder, BREAKS)
    assert "remove" not in str(caught.value)
