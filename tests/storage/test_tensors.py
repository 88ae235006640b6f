"""Arrays read back exactly, equal arrays give equal bytes, and a damaged file is named."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy

from dextron_bench.storage import tensors

ARRAYS = {
    "a": np.arange(6, dtype=np.float64).reshape(2, 3).T,
    "b": np.array([1, 2], np.uint8),
    "c": np.float32(0.5).reshape(()),
}


@pytest.mark.parametrize("function", [tensors.read, tensors.memory_mapped])
def test_arrays_and_metadata_read_back(tmp_path: Path, function: Callable[[Path], dict[str, np.ndarray]]):
    file = tmp_path / "a.safetensors"
    tensors.write(file, ARRAYS, {"epoch": 3, "label": "bc"})
    arrays = function(file)
    assert arrays.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert arrays[name].dtype == array.dtype
        np.testing.assert_array_equal(arrays[name], array)
    assert tensors.read_about(file) == {"epoch": 3, "label": "bc"}


def test_arrays_in_memory_are_writable_and_mapped_ones_are_not(tmp_path: Path):
    file = tmp_path / "a.safetensors"
    tensors.write(file, ARRAYS, {})
    tensors.read(file)["a"][0, 0] = 9.0
    with pytest.raises(ValueError, match="read-only"):
        tensors.memory_mapped(file)["a"][0, 0] = 9.0


def test_equal_arrays_and_metadata_give_equal_bytes(tmp_path: Path):
    tensors.write(tmp_path / "a", ARRAYS, {"x": 1, "y": 2})
    tensors.write(tmp_path / "b", dict(reversed(ARRAYS.items())), {"y": 2, "x": 1})
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_an_array_with_more_bytes_than_its_shape_needs_is_damaged(tmp_path: Path):
    """One number of 8 bytes, and an entry that says 16."""
    header = json.dumps({"a": {"dtype": "F64", "shape": [1], "data_offsets": [0, 16]}}).encode()
    file = tmp_path / "a.safetensors"
    file.write_bytes(len(header).to_bytes(8, "little") + header + bytes(16))
    with pytest.raises(tensors.BadTensors, match=r"an array of shape \(1,\) has 16 bytes"):
        tensors.memory_mapped(file)


@pytest.mark.parametrize(
    "content", [b"", b"12345678", (2**60).to_bytes(8, "little") + b"{", (5).to_bytes(8, "little") + b'{"a":']
)
@pytest.mark.parametrize("function", [tensors.read, tensors.memory_mapped, tensors.read_about])
def test_a_damaged_file_is_named(tmp_path: Path, content: bytes, function: Callable[[Path], object]):
    file = tmp_path / "a.safetensors"
    file.write_bytes(content)
    with pytest.raises(tensors.BadTensors, match=r"a\.safetensors is damaged or not a safetensors file \(.+\)"):
        function(file)


@pytest.mark.parametrize("function", [tensors.read, tensors.memory_mapped, tensors.read_about])
def test_a_header_that_fills_the_memory_is_not_parsed(tmp_path: Path, function: Callable[[Path], object]):
    file = tmp_path / "a.safetensors"
    about = json.dumps("[" + "{}," * (tensors.LONGEST_HEADER // 3) + "0]")
    header = f'{{"__metadata__": {{"about": {about}}}}}'.encode()
    file.write_bytes(len(header).to_bytes(8, "little") + header)
    with pytest.raises(tensors.BadTensors, match="its header is longer than 16 MiB"):
        function(file)


def test_a_folder_is_not_a_file_of_arrays(tmp_path: Path):
    with pytest.raises(tensors.BadTensors, match="it is not a regular file"):
        tensors.read(tmp_path)


def flipped(file: Path, part: bytes) -> None:
    """Flips the last bit of the first appearance of a part of a file."""
    content = bytearray(file.read_bytes())
    content[content.index(part)] ^= 1
    file.write_bytes(content)


def test_a_flipped_bit_in_an_array_is_noticed(tmp_path: Path):
    file = tmp_path / "a.safetensors"
    tensors.write(file, ARRAYS, {"epoch": 3})
    flipped(file, np.float32(0.5).tobytes())
    with pytest.raises(tensors.BadTensors, match="its values differ from the digest"):
        tensors.read(file)
    assert tensors.read_about(file) == {"epoch": 3}
    with pytest.raises(tensors.BadTensors, match="its values differ from the digest"):
        tensors.check(file, tensors.memory_mapped(file))


def test_a_flipped_bit_in_the_metadata_is_noticed(tmp_path: Path):
    file = tmp_path / "a.safetensors"
    tensors.write(file, ARRAYS, {"label": "bc"})
    flipped(file, b"bc")
    with pytest.raises(tensors.BadTensors, match="its metadata differs from the digest"):
        tensors.read_about(file)


def test_a_file_without_digests_is_read(tmp_path: Path):
    file = tmp_path / "a.safetensors"
    file.write_bytes(safetensors.numpy.save({"a": ARRAYS["b"]}, {"about": '{"label": "bc"}'}))
    assert tensors.read(file)["a"].tolist() == [1, 2]
    assert tensors.read_about(file) == {"label": "bc"}


def test_a_file_that_cannot_be_mapped_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Some FUSE file systems map no files."""
    file, array = tmp_path / "a.safetensors", np.arange(6.0).reshape(2, 3)
    tensors.write(file, {"a": array, "b": array[:0]}, {})

    def refuse(*_: object) -> None:
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))

    monkeypatch.setattr(np, "memmap", refuse)
    arrays = tensors.memory_mapped(file)
    np.testing.assert_array_equal(arrays["a"], array)
    assert arrays["b"].shape == (0, 3)
    with pytest.raises(ValueError, match="read-only"):
        arrays["a"][0, 0] = 9.0


def test_a_lack_of_memory_is_no_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    tensors.write(tmp_path / "a.safetensors", {"a": np.zeros(3)}, {})

    def fail(_: bytes) -> None:
        raise MemoryError

    monkeypatch.setattr(tensors, "load", fail)
    with pytest.raises(MemoryError):
        tensors.read(tmp_path / "a.safetensors")
