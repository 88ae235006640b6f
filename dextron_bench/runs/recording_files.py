"""The recordings of a run, and the manifest of their hashes."""

from __future__ import annotations

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
    """Writes the recording of an episode as `write` does, and its hash in the manifest."""
    file = folder.recording(split.name, row)
    add_to_manifest(folder, {file.name: write(folder, source, split, row, episode, about)})


def write(folder: RunFolder, source: Source, split: Split, row: int, episode: Episode, about: dict[str, Any]) -> str:
    """Writes the recording of an episode, with what the shipped success model predicts; returns its SHA-256.

    `about` names method, source of reaches and seed. The recording also says why the episode ended as it did.
    """
    from dextron_bench import recording  # Loads Rerun, which evaluation alone does not need.

    cause = diagnosis.diagnose(episode, split.cases[row]).cause
    properties = {**about, "split": split.name, "split_digest": split.digest, "row": row, "cause": cause}
    properties["physics"] = model.mjcf_hash()
    file, path = folder.recording(split.name, row), source.path(episode.setting)
    return recording.write(file, episode, path, properties, _predictions(source, split.cases[row], episode))


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
