"""Reads and writes the table of episodes and the weights of a run."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

import pandas as pd

from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, hashing, tables
from dextron_bench.storage.folder_config import RUN_ADVICE, FolderMismatch
from dextron_bench.storage.run_folder import RunFolder


def stored_episodes(folder: RunFolder, splits: Sequence[Split]) -> pd.DataFrame:
    """The stored table of episodes, without the episodes of splits that changed since; raises DamagedFile."""
    file = folder.episodes
    if not file.exists():
        return pd.DataFrame()
    table = tables.read_own(file, tables.EPISODES)
    digests = table["split"].map({split.name: split.digest for split in splits})
    return table[digests.isna() | (digests == table["digest"])]


def store_episodes(folder: RunFolder, table: pd.DataFrame) -> None:
    """Replaces the table of episodes of a run."""
    tables.write(folder.episodes, table)


def failures(folders: Iterable[RunFolder]) -> dict[str, int]:
    """The number of failed episodes of runs for each reason."""
    read = [pd.read_parquet(folder.episodes, columns=["failure"]) for folder in folders]
    reasons = pd.concat(read)["failure"].str.replace(r" at step \d+$", "", regex=True)
    return {str(reason): int(count) for reason, count in reasons[reasons != ""].value_counts().items()}


def copy_weights(file: Path, folder: RunFolder) -> str:
    """Copies weights into the folder of a run, and returns their SHA-256; each file is read once.

    Raises FolderMismatch if the folder holds other weights.
    """
    if not folder.weights.exists():
        atomic.write_atomically(folder.weights, lambda part: shutil.copyfile(file, part))
    sha256 = hashing.sha256(folder.weights)
    if file != folder.weights and hashing.sha256(file) != sha256:
        raise FolderMismatch(f"{folder.path} holds a run with other weights; {RUN_ADVICE}")
    return sha256
