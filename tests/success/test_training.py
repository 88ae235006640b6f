"""Training of the success model: the same bytes after a stop, the best epoch, and what it learns."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.errors import BadInput
from dextron_bench.storage import records, tensors
from dextron_bench.success.fit import Fit
from dextron_bench.success.training import MODEL, STATE, TrainingConfig, train
from tests.success.test_dataset import block_file, write_block
from tests.success.test_generation import file_contents

SHORT = TrainingConfig(epochs=2, updates=3, batch=8)


@pytest.fixture
def trained(tmp_path: Path) -> Path:
    """A folder with a data set and a finished training."""
    write_block(tmp_path / "trained", 0, [30] * 10, [0, 1] * 5)
    train(tmp_path / "trained", SHORT)
    return tmp_path / "trained"


@pytest.mark.slow
def test_a_stopped_training_ends_with_the_same_bytes(trained: Path, tmp_path: Path):
    write_block(tmp_path / "stopped", 0, [30] * 10, [0, 1] * 5)

    def stop(done: int, total: int, note: str = "") -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "stopped", SHORT, stop)
    train(tmp_path / "stopped", SHORT)
    assert file_contents(tmp_path / "stopped") == file_contents(trained)


@pytest.mark.slow
def test_a_training_with_fewer_epochs_continues_to_the_same_bytes(trained: Path, tmp_path: Path):
    write_block(tmp_path / "continued", 0, [30] * 10, [0, 1] * 5)
    train(tmp_path / "continued", replace(SHORT, epochs=1))
    train(tmp_path / "continued", SHORT)
    assert file_contents(tmp_path / "continued") == file_contents(trained)
    with pytest.raises(BadInput, match="holds another training"):
        train(tmp_path / "continued", replace(SHORT, epochs=1))


def test_the_learning_rate_is_halved_every_hundred_epochs(tmp_path: Path, rates: list[float]):
    """Table II; here every two."""
    assert TrainingConfig() == TrainingConfig(batch=1024, learning_rate=1e-3, halved_every=100)
    write_block(tmp_path, 0, [30] * 10, [0, 1] * 5)
    train(tmp_path, TrainingConfig(epochs=5, updates=1, batch=8, halved_every=2))
    assert rates == [1e-3, 1e-3, 5e-4, 5e-4, 2.5e-4]


def test_the_model_keeps_its_learning_curve_and_its_best_epoch(trained: Path):
    fit = records.read_about(trained / MODEL, Fit)
    assert [point.epoch for point in fit.curve] == [1, 2]
    losses = [point.test_loss for point in fit.curve]
    assert losses[fit.best_epoch - 1] == min(losses)


@pytest.mark.slow
def test_other_settings_impossible_settings_and_a_model_as_state_are_refused(trained: Path):
    with pytest.raises(BadInput, match="holds another training"):
        train(trained, TrainingConfig(epochs=2, updates=4, batch=8))
    with pytest.raises(BadInput, match="above 0"):
        TrainingConfig(updates=0)
    with pytest.raises(BadInput, match="0 or more, not -1"):
        TrainingConfig(seed=-1)
    shutil.copyfile(trained / MODEL, trained / STATE)
    with pytest.raises(tensors.BadTensors, match=r"fit\.safetensors .*not an unfinished training"):
        train(trained, SHORT)


@pytest.mark.slow
def test_the_model_is_from_the_epoch_with_the_lowest_held_out_loss(tmp_path: Path):
    """Outcomes are random and episodes are few, so every epoch makes the predictions on held-out episodes worse."""
    rng = np.random.default_rng(1)
    arrays = {"states": rng.normal(size=(60, 48)).astype(np.float32), "actions": np.zeros(60, np.float32)}
    arrays |= {"starts": np.arange(61), "solved": rng.integers(0, 2, 60).astype(np.uint8)}
    tensors.write(block_file(tmp_path, 0), arrays, {})
    long, short = (TrainingConfig(epochs=epochs, updates=20, batch=32) for epochs in (4, 1))
    train(tmp_path, long)
    assert tensors.read_about(tmp_path / MODEL)["best_epoch"] == 1
    best = tensors.read(tmp_path / MODEL)
    (tmp_path / STATE).unlink()
    train(tmp_path, short)
    for name, array in tensors.read(tmp_path / MODEL).items():
        np.testing.assert_array_equal(array, best[name])


@pytest.mark.slow
def test_training_learns_an_outcome_that_depends_on_the_state(tmp_path: Path):
    """Success depends on the sign of one number of the state, so the model predicts almost all outcomes correctly."""
    rng = np.random.default_rng(0)
    states = rng.normal(size=(3000, 48)).astype(np.float32)
    arrays = {"states": states, "actions": rng.uniform(-1, 1, 3000).astype(np.float32), "starts": np.arange(3001)}
    tensors.write(block_file(tmp_path, 0), arrays | {"solved": (states[:, 5] > 0).astype(np.uint8)}, {})
    model = train(tmp_path, TrainingConfig(epochs=1, updates=200, batch=256))
    probe = np.zeros((2, 48))
    probe[:, 5] = [-1.0, 1.0]
    low, high = model.chance(probe, np.zeros(2))
    assert low < 0.05
    assert high > 0.95
    assert records.read_about(tmp_path / MODEL, Fit).curve[0].test_accuracy > 0.9
