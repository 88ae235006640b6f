"""Reading the success model's data set: held-out episodes, and errors that name the bad file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dextron_bench.storage import tensors
from dextron_bench.success.dataset import BadDataset, Dataset, EmptyDataset


def block_file(folder: Path, number: int) -> Path:
    """The file of a block in the folder of a data set."""
    return folder / "blocks" / f"{number:06d}.safetensors"


def write_block(folder: Path, number: int, lengths: list[int], solved: list[int]) -> None:
    """Writes a block in which the numbers of row r of block n are 100 n + r, for actions divided by 1000."""
    rows = np.arange(sum(lengths), dtype=np.float32) + 100 * number
    arrays = {"states": np.tile(rows[:, None], 48), "actions": rows / 1000, "starts": np.cumsum([0, *lengths])}
    tensors.write(block_file(folder, number), arrays | {"solved": np.array(solved, np.uint8)}, {})


def test_every_fifth_setting_is_for_testing_and_rows_keep_their_outcome(tmp_path: Path):
    write_block(tmp_path, 0, [2, 1, 1, 1, 3], [1, 0, 0, 0, 1])
    write_block(tmp_path, 1, [1, 2], [0, 1])
    train, test = Dataset(tmp_path), Dataset(tmp_path, test=True)
    assert (len(train), len(test)) == (8, 3)
    states, actions, outcomes = train.take(np.arange(8))
    assert states[:, 7].tolist() == [0, 1, 2, 3, 4, 100, 101, 102]
    np.testing.assert_allclose(actions, states[:, 0] / 1000)
    assert outcomes.tolist() == [1, 1, 0, 0, 0, 0, 1, 1]
    states, _, outcomes = test.take(np.array([2, 0]))
    assert states[:, 0].tolist() == [7, 5]
    assert outcomes.tolist() == [1, 1]


def test_all_episodes_of_a_setting_are_on_one_side(tmp_path: Path):
    """Settings a to f appear in the order a b a c d | e b e f: the fifth is e, with both of its episodes."""
    for number, first in enumerate(([1, 2, 1, 3, 4], [5, 2, 5, 6])):
        states = np.tile(np.array(first, np.float32)[:, None], 48)
        arrays = {"states": states, "actions": np.arange(len(first), dtype=np.float32) + 10 * number}
        solved = np.arange(len(first), dtype=np.uint8) % 2
        tensors.write(
            block_file(tmp_path, number), arrays | {"starts": np.arange(len(first) + 1), "solved": solved}, {}
        )
    train, test = Dataset(tmp_path), Dataset(tmp_path, test=True)
    assert test.take(np.arange(len(test)))[1].tolist() == [10, 12]
    assert train.take(np.arange(len(train)))[1].tolist() == [0, 1, 2, 3, 4, 11, 13]


def test_a_data_set_with_few_settings_is_refused(tmp_path: Path):
    write_block(tmp_path, 0, [1, 1, 1, 1], [0, 1, 0, 1])
    with pytest.raises(BadDataset, match="have fewer than 5 settings, so none can be held out"):
        Dataset(tmp_path, test=True)


def test_a_folder_without_a_usable_data_set_is_refused(tmp_path: Path):
    with pytest.raises(EmptyDataset, match="success data"):
        Dataset(tmp_path)
    write_block(tmp_path, 0, [2], [1])
    file = block_file(tmp_path, 0)
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(BadDataset, match=r"000000\.safetensors is damaged.*; remove it, and run .*success data"):
        Dataset(tmp_path)
    write_block(tmp_path, 0, [2], [1])
    with pytest.raises(BadDataset, match=r"all episodes .* have the same outcome.*more --rows"):
        Dataset(tmp_path)
    write_block(tmp_path, 2, [2], [0])
    with pytest.raises(BadDataset, match="lacks block 000001"):
        Dataset(tmp_path)


def test_a_flipped_bit_in_a_block_is_noticed(tmp_path: Path):
    write_block(tmp_path, 0, [2, 3], [1, 0])
    file = block_file(tmp_path, 0)
    assert len(Dataset(tmp_path)) == 5
    content = bytearray(file.read_bytes())
    content[-9] ^= 1
    file.write_bytes(content)
    with pytest.raises(BadDataset, match=r"000000\.safetensors is damaged.* differ from the digest .*; remove it"):
        Dataset(tmp_path)


def test_blocks_with_missing_arrays_wrong_shapes_or_nan_are_refused(tmp_path: Path):
    write_block(tmp_path, 0, [2, 3], [1, 0])
    file = block_file(tmp_path, 0)
    arrays = tensors.read(file)
    tensors.write(file, {name: arrays[name] for name in ("states", "actions", "starts")}, {})
    with pytest.raises(BadDataset, match="lacks 'solved'"):
        Dataset(tmp_path)
    tensors.write(file, arrays | {"starts": arrays["starts"][:-1]}, {})
    with pytest.raises(BadDataset, match=r"has an array 'starts' of the wrong shape \(2,\)"):
        Dataset(tmp_path)
    arrays["states"][3, 7] = np.nan
    tensors.write(file, arrays, {})
    assert len(Dataset(tmp_path).take(np.array([0, 1]))[1]) == 2
    with pytest.raises(BadDataset, match=r"000000\.safetensors holds numbers that are not finite"):
        Dataset(tmp_path).take(np.array([3]))
