"""The files of a run: whose it is, its episodes, its recordings and its result."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.methods.weights import FILE
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, folder_config, hashing, provenance
from dextron_bench.storage.folder_config import FolderMismatch
from dextron_bench.world import model

CONFIG = "config.json"
PROVENANCE = "provenance.json"
EPISODES = "episodes.parquet"
HELD = "run", "remove it, or choose another folder with --runs"


def check(folder: Path, config: dict[str, Any]) -> None:
    """Raises FolderMismatch where the folder holds a run of another config, DamagedFile where that cannot be told."""
    folder_config.check(folder / CONFIG, config, *HELD)


def claim(folder: Path, config: dict[str, Any]) -> None:
    """Makes the folder the run's that has this config; raises what `check` does."""
    if not (folder / CONFIG).exists():  # Written last, so that whoever finds it finds the rest.
        atomic.write_json(folder / PROVENANCE, provenance.collect(model.mjcf_hash()))
    folder_config.write_or_check(folder / CONFIG, config, *HELD)


def stored(folder: Path, wanted: Sequence[Split]) -> pd.DataFrame:
    """Episodes already in the folder, less those of splits that have changed since; raises DamagedFile."""
    file = folder / EPISODES
    if not file.exists():
        return pd.DataFrame()
    try:
        episodes = pd.read_parquet(file)
        now = episodes["split"].map({split.name: split.digest for split in wanted})
        return episodes[now.isna() | (now == episodes["digest"])]
    except (OSError, ValueError, KeyError) as error:
        raise atomic.DamagedFile(file, error) from error


def store(folder: Path, episodes: pd.DataFrame) -> None:
    """Puts all episodes of a run in place of those that were there."""
    atomic.write_atomically(folder / EPISODES, lambda part: episodes.to_parquet(part))


def adopt(file: Path, folder: Path) -> Path:
    """Copies weights into a run's folder, or checks that they are those there; raises FolderMismatch."""
    own = folder / FILE
    if not own.exists():
        atomic.write_atomically(own, lambda part: shutil.copyfile(file, part))
    if hashing.sha256(own) != hashing.sha256(file):
        raise FolderMismatch(
            f"{folder} holds a run with other weights; remove it, or choose another folder with --runs"
        )
    return own
