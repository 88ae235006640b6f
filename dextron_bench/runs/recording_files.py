"""The recordings of a run, and the manifest of their hashes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation import diagnosis
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.experts.policies import Case
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, schemas
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.success import network
from dextron_bench.success.predict import predict
from dextron_bench.world import model


def any_missing(folder: RunFolder, table: pd.DataFrame, record: int) -> bool:
    """True if the recording of one of the first `record` rows is missing.

    An episode that failed before its first step has no recording.
    """
    rows = table[(table["row"] < record) & (table["length"] > 0)]
    files = (folder.recording(split, row) for split, row in zip(rows["split"], rows["row"], strict=True))
    return not all(file.exists() for file in files)


def record(folder: RunFolder, source: Source, split: Split, row: int, episode: Episode, about: dict[str, Any]) -> None:
    """Writes the recording of an episode, and its hash in the manifest; `about` is as in `properties`."""
    file = folder.recording(split.name, row)
    case = split.case(row)
    about = properties(split, row, about, diagnosis.diagnose(episode, case).cause)
    sha256 = write(source, file, case, episode, about)
    add_to_manifest(folder, {file.name: sha256})


def properties(split: Split, row: int, about: dict[str, Any], cause: str) -> dict[str, Any]:
    """The properties of the recording of a row; `about` names method, source of reaches and seed."""
    return {**about, "split": split.name, "split_digest": split.digest, "row": row, "cause": cause}


def write(source: Source, file: Path, case: Case, episode: Episode, about: dict[str, Any]) -> str:
    """Writes the recording of an episode of a case, with properties `about`; returns its SHA-256.

    It also has what the shipped success model predicts. Raises UnwritableRecording.
    """
    from dextron_bench import recording  # Loads Rerun, which evaluation alone does not need.

    about = {**about, "physics": model.mjcf_hash()}
    return recording.write(file, episode, source.path(episode.setting), about, _predictions(source, case, episode))


def add_to_manifest(folder: RunFolder, hashes: dict[str, str]) -> None:
    """Adds the SHA-256 of recordings, by the file's name, to the manifest of a run."""
    atomic.write_json(folder.manifest, manifest(folder) | hashes)


def manifest(folder: RunFolder) -> dict[str, str]:
    """The SHA-256 of each recording of a run by the file's name; raises DamagedFile."""
    return schemas.read(folder.manifest, schemas.RECORDINGS) if folder.manifest.exists() else {}


def _predictions(source: Source, case: Case, episode: Episode) -> StepPredictions | None:
    """Predictions of the success model that ships for the source; None if none ships."""
    try:
        success_model = network.shipped_model(source.name)
    except network.MissingModel:
        return None
    return predict(success_model, source, case, episode)
