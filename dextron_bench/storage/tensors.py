"""Named arrays and what they are about in one file: safetensors, which holds numbers and text and runs no code."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import load, save

from dextron_bench.storage import atomic

ABOUT = "about"  # The one key of a file's metadata, as the order of several would be left to chance.
KINDS = {"F64": "<f8", "F32": "<f4", "I64": "<i8", "I32": "<i4", "U8": "u1"}
LENGTH = 8  # [bytes] of the header's own length at the start of a file.


class BadTensors(ValueError):
    """A file that is not whole, or is none of these."""

    def __init__(self, file: Path, why: object) -> None:
        super().__init__(f"{file} is damaged or no safetensors file ({why})")


def write(file: Path, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> None:
    """Writes a file whole; equal arrays and `about`, JSON values, give equal bytes."""
    content = save(
        {name: np.asarray(array, order="C") for name, array in arrays.items()},
        {ABOUT: json.dumps(about, sort_keys=True)},
    )
    atomic.write_atomically(file, lambda part: part.write_bytes(content))


def read(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a file; raises BadTensors, OSError."""
    content = _content(file)
    try:
        return {name: array.copy() for name, array in load(content).items()}  # Copies can be written to.
    except Exception as error:  # Whatever a hostile header leads to.
        raise BadTensors(file, " ".join(str(error).split()) or type(error).__name__) from error


def mapped(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a file, read-only and left on the disk until they are looked at; raises BadTensors, OSError."""
    with file.open("rb") as opened:
        length = int.from_bytes(opened.read(LENGTH), "little")
        header = opened.read(min(length, file.stat().st_size))
    try:
        entries = {name: entry for name, entry in json.loads(header).items() if name != "__metadata__"}
        return {name: _mapped(file, LENGTH + length, entry) for name, entry in entries.items()}
    except (ValueError, AttributeError, TypeError, KeyError, RecursionError) as error:
        raise BadTensors(file, error) from error


def read_about(file: Path) -> dict[str, Any]:
    """What a file says that it is about, empty where it says nothing; raises BadTensors, OSError."""
    with file.open("rb") as opened:
        length = int.from_bytes(opened.read(LENGTH), "little")
        header = opened.read(min(length, file.stat().st_size))
    try:
        found = json.loads(json.loads(header).get("__metadata__", {}).get(ABOUT, "{}"))
        return found if isinstance(found, dict) else {}
    except (ValueError, AttributeError, TypeError, RecursionError) as error:
        raise BadTensors(file, "its header cannot be read") from error


def _mapped(file: Path, start: int, entry: Mapping[str, Any]) -> np.ndarray:
    kind, shape = np.dtype(KINDS[entry["dtype"]]), tuple(entry["shape"])
    begin, end = entry["data_offsets"]
    if end - begin != kind.itemsize * int(np.prod(shape)):
        raise ValueError(f"an array of shape {shape} has {end - begin} bytes")
    return np.memmap(file, kind, "r", start + begin, shape)


def _content(file: Path) -> bytes:
    if file.exists() and not file.is_file():
        raise BadTensors(file, "it is no plain file")
    return file.read_bytes()
