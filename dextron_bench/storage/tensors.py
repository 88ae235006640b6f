"""Named arrays with metadata in one file, in the safetensors format; reading a file runs no code from it.

A file carries a digest of its metadata and one of its arrays, and reading compares them: a flipped bit has no other
sign. Files of version 0.1 and files of others have none.
"""

from __future__ import annotations

import errno
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import load, save

from dextron_bench.errors import BadInput
from dextron_bench.storage import atomic, hashing

ABOUT = "about"  # The only key of a file's metadata: several keys would have no fixed order.
DTYPES = {"F64": "<f8", "F32": "<f4", "I64": "<i8", "I32": "<i4", "U8": "u1"}
SEAL = "seal"  # Entry of the metadata that is written and removed here: its own digest, and the arrays'.
NO_MAPS = atomic.LACKING | {errno.ENODEV}  # Of a file system whose files cannot be mapped; they are read instead.
LENGTH = 8  # [bytes] at the start of a file that hold the length of the header.
LONGEST_HEADER = 16 * 2**20  # [bytes]; a parsed header takes up to thirty times as much memory.


class BadTensors(BadInput):
    """A file that is damaged or not a safetensors file."""

    def __init__(self, file: Path, why: object) -> None:
        super().__init__(f"{file} is damaged or not a safetensors file ({why})")


class OtherTensors(BadTensors):
    """A file that is whole, but does not hold what this version writes."""

    def __init__(self, file: Path, why: object) -> None:
        ValueError.__init__(self, f"{file} is of another version or for another purpose ({why})")


def write(file: Path, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> None:
    """Writes a file atomically; equal arrays and equal metadata `about`, JSON values, give equal bytes."""
    sealed = {**about, SEAL: [_digest_of_about(about), digest(arrays)]}
    content = save(
        {name: np.asarray(array, order="C") for name, array in arrays.items()},
        {ABOUT: json.dumps(sealed, sort_keys=True)},
    )
    atomic.write_atomically(file, lambda part: part.write_bytes(content))


def digest(arrays: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of names, types, shapes and values of arrays."""
    parts = ((name, np.asarray(arrays[name], order="C")) for name in sorted(arrays))
    return hashing.digest(*(p for name, a in parts for p in (f"{name} {a.dtype.str} {a.shape}".encode(), a.tobytes())))


def read(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a file, writable; raises BadTensors, OSError."""
    content = _content(file)
    _header(file)
    try:
        arrays = {name: array.copy() for name, array in load(content).items()}  # Copies are writable.
    except MemoryError:  # The file may be whole.
        raise
    except Exception as error:  # A malicious header may raise any error.
        raise BadTensors(file, " ".join(str(error).split()) or type(error).__name__) from error
    check(file, arrays)
    return arrays


def check(file: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Raises BadTensors if the arrays are not those that were written into a file; reads all of them."""
    if _about_and_seal(file)[1] not in (None, digest(arrays)):
        raise BadTensors(file, "its values differ from the digest that it carries")


def memory_mapped(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a file, read-only and loaded from the disk when they are used; `check` compares their digest.

    Raises BadTensors, OSError.
    """
    length, header = _header(file)
    try:
        entries = {name: entry for name, entry in json.loads(header).items() if name != "__metadata__"}
        return {name: _memory_map(file, LENGTH + length, entry) for name, entry in entries.items()}
    except (ValueError, AttributeError, TypeError, KeyError, RecursionError) as error:
        raise BadTensors(file, error) from error


def read_about(file: Path) -> dict[str, Any]:
    """The metadata of a file, empty if it has none; raises BadTensors, OSError."""
    return _about_and_seal(file)[0]


def _about_and_seal(file: Path) -> tuple[dict[str, Any], Any]:
    """The metadata of a file, and the digest of its arrays or None; raises BadTensors, OSError."""
    _, header = _header(file)
    try:
        about = json.loads(json.loads(header).get("__metadata__", {}).get(ABOUT, "{}"))
        about = about if isinstance(about, dict) else {}
        of_about, of_arrays = about.pop(SEAL, (None, None))
    except (ValueError, AttributeError, TypeError, RecursionError) as error:
        raise BadTensors(file, "its header cannot be read") from error
    if of_about not in (None, _digest_of_about(about)):
        raise BadTensors(file, "its metadata differs from the digest that it carries")
    return about, of_arrays


def _digest_of_about(about: Mapping[str, Any]) -> str:
    return hashing.digest(json.dumps(about, sort_keys=True).encode())


def _header(file: Path) -> tuple[int, bytes]:
    """The length of the header that a file states, and the header; raises BadTensors, OSError."""
    with file.open("rb") as content:
        length = int.from_bytes(content.read(LENGTH), "little")
        if length > LONGEST_HEADER:
            raise BadTensors(file, f"its header is longer than {LONGEST_HEADER / 2**20:g} MiB")
        return length, content.read(length)


def _memory_map(file: Path, start: int, entry: Mapping[str, Any]) -> np.ndarray:
    """The array of a header's entry; `start` is the position of the data in the file [bytes]."""
    dtype, shape = np.dtype(DTYPES[entry["dtype"]]), tuple(entry["shape"])
    begin, end = entry["data_offsets"]
    if end - begin != dtype.itemsize * int(np.prod(shape)):
        raise ValueError(f"an array of shape {shape} has {end - begin} bytes")
    try:
        return np.memmap(file, dtype, "r", start + begin, shape)
    except OSError as error:
        if error.errno not in NO_MAPS:
            raise
    array = np.fromfile(file, dtype, int(np.prod(shape)), offset=start + begin).reshape(shape)
    array.flags.writeable = False
    return array


def _content(file: Path) -> bytes:
    if file.exists() and not file.is_file():
        raise BadTensors(file, "it is not a regular file")
    return file.read_bytes()
