"""The list in a checkpoint: the SHA-256 of every file that belongs to it.

A training that continues from other files than those that it wrote would end with other weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from dextron_bench.storage import hashing
from dextron_bench.storage.atomic import DamagedFile, IncompleteFolder


def hashes(folder: Path, files: list[Path]) -> dict[str, str]:
    """The SHA-256 of files below a folder, by their paths in it."""
    return {file.relative_to(folder).as_posix(): hashing.sha256(file) for file in files}


def check(folder: Path, listed: Mapping[str, str], present: list[Path]) -> None:
    """Raises DamagedFile for a file below a folder that is missing, changed, or among `present` and not listed."""
    for file in present:
        if (name := file.relative_to(folder).as_posix()) not in listed:
            raise DamagedFile(folder, f"{name} does not belong to its checkpoint", f"move {name} out of it")
    for name, sha256 in listed.items():
        file = folder / name
        if not file.is_file():
            raise IncompleteFolder(folder, f"{name} is missing, and its checkpoint needs it")
        if hashing.sha256(file) != sha256:
            raise DamagedFile(folder, f"{name} has another SHA-256 than its checkpoint lists")
