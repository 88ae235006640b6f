"""The success model: its data set, its network, its training, and how it is judged."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from baselines.floors import Nothing
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.storage import folder_config, tensors
from dextron_bench.success import metrics
from dextron_bench.success.dataset import BadDataset, Dataset, EmptyDataset
from dextron_bench.success.generation import (
    POLICY,
    SOLVED,
    UNIFORM,
    BadDatasetConfig,
    DatasetConfig,
    Tally,
    block_file,
    draw_cases,
    generate,
)
from dextron_bench.success.network import GRID, SIZES, BadModel, MissingModel, SuccessModel, shipped_model
from dextron_bench.success.training import MODEL, STATE, BadTrainingConfig, TrainingConfig, train
from dextron_bench.success.training import initial_network as fit_network
from tests.helpers.short_reaches import SETTINGS, SOURCE

TRAIN = [Case(setting, Expert(1.2, 0.3), 0.1) for setting in SETTINGS]
SMALL = DatasetConfig("synthetic", block=5, policies=("nothing",))
BRIEF = TrainingConfig(epochs=2, updates=3, batch=8)


def gather(folder: Path, rows: int, collection: DatasetConfig = SMALL, threads: int = 1) -> dict[str, Tally]:
    return generate(SOURCE, TRAIN, collection, folder, rows, {"nothing": Nothing().agent(0)}, threads)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


# Data


def test_kinds_go_round_so_that_half_is_the_experts_and_half_the_policies():
    assert [SMALL.kind(number) for number in range(5)] == [SOLVED, POLICY, UNIFORM, POLICY, SOLVED]
    assert [DatasetConfig().kind(number) for number in range(3)] == [SOLVED, UNIFORM, SOLVED]
    two = DatasetConfig(policies=("a", "b"))
    assert [two.player(number) for number in (1, 3, 5, 7)] == ["a", "b", "a", "b"]


def test_uniform_episodes_stay_with_the_reaches_of_train_and_draw_anew():
    known = TRAIN[0].setting.reach
    drawn = draw_cases(SOURCE, TRAIN[:1], DatasetConfig(block=40), number=1)
    assert {case.setting.reach for case in drawn} == {known}
    assert len({case.setting.offset_x for case in drawn}) == 40
    gains, criticals = zip(*((case.expert.gain, case.expert.critical) for case in drawn), strict=True)
    assert min(gains) >= 1.0
    assert max(gains) <= 1.5
    assert min(criticals) >= 0.01
    assert max(criticals) <= 0.9
    assert max(criticals) - min(criticals) > 0.5


def test_a_stopped_collection_goes_on_to_the_same_bytes_on_any_number_of_threads(tmp_path: Path):
    whole = gather(tmp_path / "a", 600)
    gather(tmp_path / "b", 100, threads=2)
    assert gather(tmp_path / "b", 600, threads=2) == whole
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    assert sum(tally.rows for tally in whole.values()) >= 600
    assert whole[POLICY].episodes == 5 * sum(SMALL.kind(n) == POLICY for n in range(len(contents(tmp_path / "a")) - 1))


def test_a_block_holds_what_was_played(tmp_path: Path):
    gather(tmp_path, 1)
    block = tensors.read(block_file(tmp_path, 0))
    assert block["states"].shape == (block["starts"][-1], 48)
    assert block["states"].dtype == block["actions"].dtype == np.float32
    np.testing.assert_array_equal(block["actions"][block["starts"][:-1]], 0.0)  # An expert's first action.
    per_row = block_file(tmp_path, 0).stat().st_size / len(block["actions"])
    assert per_row < 200 or len(block["actions"]) < 1000


def test_another_data_set_in_the_folder_is_told(tmp_path: Path):
    gather(tmp_path, 1)
    with pytest.raises(folder_config.FolderMismatch, match="choose another folder"):
        gather(tmp_path, 1, DatasetConfig("synthetic", seed=1, block=5))
    with pytest.raises(BadDatasetConfig, match="at least 5 episodes"):
        DatasetConfig(block=0)


def write(folder: Path, number: int, lengths: list[int], solved: list[int]) -> None:
    """A block whose states and actions count its rows."""
    rows = np.arange(sum(lengths), dtype=np.float32) + 100 * number
    arrays = {"states": np.tile(rows[:, None], 48), "actions": rows / 1000, "starts": np.cumsum([0, *lengths])}
    tensors.write(block_file(folder, number), arrays | {"solved": np.array(solved, np.uint8)}, {})


def test_every_fifth_episode_is_held_out_and_rows_keep_their_outcome(tmp_path: Path):
    write(tmp_path, 0, [2, 1, 1, 1, 3], [1, 0, 0, 0, 1])
    write(tmp_path, 1, [1, 2], [0, 1])
    data, held = Dataset(tmp_path), Dataset(tmp_path, test=True)
    assert (len(data), len(held)) == (8, 3)
    states, actions, outcomes = data.take(np.arange(8))
    assert states[:, 7].tolist() == [0, 1, 2, 3, 4, 100, 101, 102]
    np.testing.assert_allclose(actions, states[:, 0] / 1000)
    assert outcomes.tolist() == [1, 1, 0, 0, 0, 0, 1, 1]
    states, _, outcomes = held.take(np.array([2, 0]))
    assert states[:, 0].tolist() == [7, 5]
    assert outcomes.tolist() == [1, 1]


def test_no_data_set_and_a_damaged_one_are_told(tmp_path: Path):
    with pytest.raises(EmptyDataset, match="success data"):
        Dataset(tmp_path)
    write(tmp_path, 0, [2], [1])
    file = block_file(tmp_path, 0)
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(BadDataset, match=r"000000\.safetensors is damaged.*; remove it, and the same .*success data"):
        Dataset(tmp_path)
    write(tmp_path, 0, [2], [1])
    with pytest.raises(BadDataset, match=r"all episodes .* end alike"):
        Dataset(tmp_path)
    write(tmp_path, 2, [2], [0])
    with pytest.raises(BadDataset, match="lacks block 000001"):
        Dataset(tmp_path)


def test_blocks_that_lack_something_or_hold_nan_are_told(tmp_path: Path):
    write(tmp_path, 0, [2, 3], [1, 0])
    file = block_file(tmp_path, 0)
    good = tensors.read(file)
    tensors.write(file, {name: good[name] for name in ("states", "actions", "starts")}, {})
    with pytest.raises(BadDataset, match="lacks 'solved'"):
        Dataset(tmp_path)
    tensors.write(file, good | {"starts": good["starts"][:-1]}, {})
    with pytest.raises(BadDataset, match="has 'starts' of another length"):
        Dataset(tmp_path)
    good["states"][3, 7] = np.nan
    tensors.write(file, good, {})
    assert len(Dataset(tmp_path).take(np.array([0, 1]))[1]) == 2
    with pytest.raises(BadDataset, match=r"000000\.safetensors holds numbers that are not finite"):
        Dataset(tmp_path).take(np.array([3]))


def test_a_cut_block_is_no_whole_one_and_no_rows_are_no_data_set(tmp_path: Path):
    gather(tmp_path, 100)
    file = block_file(tmp_path, 0)
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(BadDataset, match=r"000000.*remove it"):
        gather(tmp_path, 100_000)
    with pytest.raises(BadDatasetConfig, match="--rows"):
        gather(tmp_path / "other", 0)
    assert not (tmp_path / "other").exists()


# Model


def arrays() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    layers = {f"layer.{i}": rng.normal(size=shape) / shape[-1] ** 0.5 for i, shape in enumerate(SIZES)}
    return layers | {"mean": rng.normal(size=48), "deviation": rng.uniform(0.5, 2.0, 48)}


def test_a_curve_is_the_chance_of_each_action_bit_for_bit():
    model, states = SuccessModel(arrays()), np.random.default_rng(1).normal(size=(4, 48))
    curve = model.curve(states)
    assert curve.shape == (4, 51)
    for place in (0, 17, 50):
        np.testing.assert_array_equal(curve[:, place], model.chance(states, np.full(4, GRID[place])))
    np.testing.assert_array_equal(model.curve(states[2:3]), curve[2:3])
    np.testing.assert_allclose(GRID[[0, 1, 50]], [-1.0, -0.96, 1.0])


def test_chances_are_a_softmax_of_two_classes_by_hand():
    still = {name: np.zeros_like(array) for name, array in arrays().items()}
    model = SuccessModel(still | {"deviation": np.ones(48), "layer.5": np.array([0.0, np.log(3.0)])})
    np.testing.assert_allclose(model.chance(np.ones((2, 48)), np.zeros(2)), 0.75, rtol=1e-6)


def test_chances_are_those_of_the_network_that_was_trained():
    network, rng = fit_network(np.random.default_rng(0)), np.random.default_rng(1)
    layers = {f"layer.{i}": parameter.detach().numpy() for i, parameter in enumerate(network.parameters())}
    states, actions = rng.normal(size=(30, 48)), rng.uniform(-1.0, 1.0, 30)
    found = network(torch.tensor(np.c_[states, actions], dtype=torch.float32)).softmax(dim=1)[:, 1]
    model = SuccessModel(layers | {"mean": np.zeros(48), "deviation": np.ones(48)})
    np.testing.assert_allclose(model.chance(states, actions), found.detach().numpy(), atol=1e-6)


def test_arrays_that_make_no_model_are_told():
    with pytest.raises(BadModel, match=r"'layer.1' is not of shape \(256,\)"):
        SuccessModel(arrays() | {"layer.1": np.zeros(3)})
    with pytest.raises(BadModel, match="not finite"):
        SuccessModel(arrays() | {"mean": np.full(48, np.nan)})
    with pytest.raises(BadModel, match="a deviation of states that is not above 0"):
        SuccessModel(arrays() | {"deviation": np.zeros(48)})
    with pytest.raises(BadModel, match=r"they hold 'adam.0.step' too; take its model\.safetensors"):
        SuccessModel(arrays() | {"adam.0.step": np.zeros(1)})
    with pytest.raises(MissingModel, match="no success model ships for minjerk"):
        shipped_model("minjerk")


# Training


def test_a_stopped_training_ends_with_the_same_bytes(tmp_path: Path):
    for folder in ("a", "b", "c"):
        write(tmp_path / folder, 0, [30] * 10, [0, 1] * 5)
    train(tmp_path / "a", BRIEF)
    train(tmp_path / "c", replace(BRIEF, epochs=1))
    train(tmp_path / "c", BRIEF)
    assert contents(tmp_path / "a") == contents(tmp_path / "c")
    with pytest.raises(folder_config.FolderMismatch, match="holds another training"):
        train(tmp_path / "c", replace(BRIEF, epochs=1))

    def stop(done: int, wanted: int, note: str) -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "b", BRIEF, stop)
    train(tmp_path / "b", BRIEF)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    told = tensors.read_about(tmp_path / "a" / MODEL)
    assert [point["epoch"] for point in told["curve"]] == [1, 2]
    losses = [point["test_loss"] for point in told["curve"]]
    assert losses[told["best_epoch"] - 1] == min(losses)
    with pytest.raises(folder_config.FolderMismatch, match="holds another training"):
        train(tmp_path / "a", TrainingConfig(epochs=2, updates=4, batch=8))
    with pytest.raises(BadTrainingConfig, match="positive"):
        TrainingConfig(updates=0)
    with pytest.raises(BadTrainingConfig, match="0 or more, not -1"):
        TrainingConfig(seed=-1)
    shutil.copyfile(tmp_path / "a" / MODEL, tmp_path / "a" / STATE)
    with pytest.raises(tensors.BadTensors, match=r"fit\.safetensors .*no training under way"):
        train(tmp_path / "a", BRIEF)


def test_the_model_is_that_of_the_epoch_with_the_lowest_loss_on_what_was_held_out(tmp_path: Path):
    """Outcomes by chance, a few episodes: the longer it trains, the worse it foretells others."""
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


def test_training_learns_what_can_be_learned(tmp_path: Path):
    """Success depends on the sign of one number of the state: almost all is predicted right."""
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
    assert tensors.read_about(tmp_path / MODEL)["curve"][0]["test_accuracy"] > 0.9


# Metrics


def test_judgement_by_hand():
    chances, outcomes = np.array([0.9, 0.6, 0.6, 0.1]), np.array([1, 1, 0, 0])
    found = metrics.evaluate(chances, outcomes)
    assert (found.rows, found.base_rate, found.accuracy, found.base_accuracy) == (4, 0.5, 0.75, 0.5)
    assert found.brier == pytest.approx((0.01 + 0.16 + 0.36 + 0.01) / 4)
    assert found.base_brier == 0.25
    assert found.auc == pytest.approx(3.5 / 4)  # Of four pairs one is a tie.
    assert found.calibration_error == pytest.approx((0.1 + 2 * 0.1 + 0.1) / 4)


def test_one_kind_of_outcome_has_no_auc():
    assert np.isnan(metrics.auc(np.array([0.2, 0.3]), np.array([1, 1])))


@given(st.lists(st.tuples(st.floats(0, 1), st.integers(0, 1)), min_size=2, max_size=30))
def test_auc_is_the_share_of_pairs_in_order(pairs: list[tuple[float, int]]):
    chances, outcomes = (np.array(column) for column in zip(*pairs, strict=True))
    wins, losses = chances[outcomes == 1], chances[outcomes == 0]
    if len(wins) and len(losses):
        gaps = wins[:, None] - losses[None, :]
        assert metrics.auc(chances, outcomes) == pytest.approx(((gaps > 0) + 0.5 * (gaps == 0)).mean())
    _, _, counts = metrics.calibration(chances, outcomes)
    assert counts.sum() == len(pairs)
