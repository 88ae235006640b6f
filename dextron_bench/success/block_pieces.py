"""Blocks of a data set that shares have played: pieces in its folder (`storage/shares.py`)."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dextron_bench.storage import atomic, provenance, shares, tensors
from dextron_bench.storage.folders import visible

SUFFIX = ".safetensors"


def work(folder: Path) -> shares.Work:
    """The generation of the data set in a folder."""
    return shares.Work(folder, provenance.code_hash())


def file_of(folder: Path, number: int) -> Path:
    """The file of a block that a share plays."""
    return work(folder).file(f"{number:06d}", SUFFIX)


def write_stamp(folder: Path, config: Mapping[str, Any], number: int) -> Path:
    """Completes the piece of a block whose file is written; `config` is what the data set depends on."""
    return work(folder).write(f"{number:06d}", config, [file_of(folder, number)])


def read(folder: Path, config: Mapping[str, Any]) -> dict[int, shares.Piece]:
    """The pieces of a data set by the number of the block; raises the errors of `shares.Work.read`."""
    return {int(name): piece for name, piece in work(folder).read(lambda name: config).items()}


def copy(piece: shares.Piece, file: Path) -> None:
    """Copies the block of a piece to a file."""
    atomic.write_atomically(file, functools.partial(shutil.copyfile, next(iter(piece.files))))


def block_sizes(folder: Path) -> dict[int, int]:
    """Numbers of transitions of the blocks in a data set and of its pieces, by the number of the block."""
    stamps = [file for file in visible(folder / shares.FOLDER, "*.json") if file.stem.isdecimal()]
    files = [file.with_suffix(SUFFIX) for file in stamps] + visible(folder / "blocks", f"[0-9]*{SUFFIX}")
    return {int(file.stem): int(tensors.read_about(file)["rows"]) for file in files}
