"""The recordings of a run, and their manifest."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation import predictions
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.experts.policies import Case
from dextron_bench.reaches import setting
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic
from dextron_bench.success import network
from dextron_bench.success.predict import predict
from dextron_bench.world import model

MANIFEST = "recordings.json"  # The SHA-256 of every recording.


def unrecorded(folder: Path, done: pd.DataFrame, record: int) -> bool:
    """Whether a recording is missing; an episode that failed before its first step has none."""
    wanted = done[(done["row"] < record) & (done["length"] > 0)]
    places = (recording_file(folder, split, row) for split, row in zip(wanted["split"], wanted["row"], strict=True))
    return not all(place.exists() for place in places)


def record(
    folder: Path, source: setting.Source, split: Split, index: int, episode: Episode, about: dict[str, Any]
) -> None:
    """Writes an episode's recording: whose it is, in `about`, and what the success model that ships thinks of it.

    The run's manifest then has the file's SHA-256.
    """
    from dextron_bench import recording

    properties = {**about, "split": split.name, "split_digest": split.digest, "row": index}
    properties["physics"] = model.mjcf_hash()
    file, path = recording_file(folder, split.name, index), source.path(episode.setting)
    sha256 = recording.write(file, episode, path, properties, _insight(source, split.cases[index], episode))
    atomic.write_json(folder / MANIFEST, manifest(folder) | {file.name: sha256})


def manifest(folder: Path) -> dict[str, str]:
    """The SHA-256 of each of a run's recordings by the file's name; raises DamagedFile."""
    return atomic.read_json(folder / MANIFEST) if (folder / MANIFEST).exists() else {}


def recording_file(folder: Path, split: str, index: int) -> Path:
    """Where the recording of a split's row lies in a run's folder."""
    return folder / "recordings" / f"{split}-{index:04d}.rrd"


def _insight(source: setting.Source, case: Case, episode: Episode) -> predictions.StepPredictions | None:
    """None where no success model ships for the source."""
    try:
        judge = network.shipped(source.name)
    except network.MissingModel:
        return None
    return predict(judge, source, case, episode)
