"""Runs in the file format of MLflow: a folder for each seed of a run, with parameters, metrics and tags as files."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

from dextron_bench.runs.catalogue import Entry
from dextron_bench.storage import hashing
from dextron_bench.storage.folders import visible
from dextron_bench.training import loop, metric_rows
from dextron_bench.world import task

EXPERIMENT, NAME = "1", "dextron-bench"
FINISHED, RUNNING, FAILED = 3, 1, 4  # Numbers of states in `meta.yaml`.


class NotEmpty(ValueError):
    """A folder that holds something already."""


def write(entries: Iterable[Entry], folder: Path) -> int:
    """Writes each seed of each entry as a run; returns the number of runs. Raises NotEmpty, OSError."""
    if visible(folder, "*"):
        raise NotEmpty(f"{folder} is not empty; choose another folder with --into")
    experiment = folder / EXPERIMENT
    _write(
        experiment / "meta.yaml",
        _yaml({
            **{"artifact_location": (experiment).resolve().as_uri(), "experiment_id": EXPERIMENT},
            **{"lifecycle_stage": "active", "name": NAME},
        }),
    )  # fmt: skip
    count = 0
    for entry in entries:
        for position, seed in enumerate(entry.seeds):
            _write_run(experiment, entry, seed, position)
            count += 1
    return count


def _write_run(experiment: Path, entry: Entry, seed: int, position: int) -> None:
    """Writes a seed of an entry."""
    number = hashing.digest(f"{entry.name} {seed}".encode())[:32]
    run, stamp = experiment / number, int(entry.changed.timestamp() * 1000)
    failed, is_done = entry.state.startswith("failed"), entry.state == "done"
    _write(
        run / "meta.yaml",
        _yaml({
            **{"artifact_uri": (run / "artifacts").resolve().as_uri(), "run_id": number, "run_uuid": number},
            **{"experiment_id": EXPERIMENT, "lifecycle_stage": "active", "run_name": f"{entry.name}/seed{seed}"},
            **{"status": FAILED if failed else FINISHED if is_done else RUNNING, "user_id": NAME},
            **{"source_name": "", "source_type": 4, "source_version": "", "entry_point_name": "", "tags": []},
            **{"start_time": stamp, "end_time": stamp if is_done else None, "deleted_time": None},
        }),
    )  # fmt: skip
    (run / "artifacts").mkdir(parents=True, exist_ok=True)
    about = {"method": entry.label, "reaches": entry.reaches, "seed": seed, "physics": entry.physics}
    code = {f"code.{name}": value for name, value in entry.code.items() if value}
    params = about | code | dict(entry.settings)
    for name, value in params.items():
        _write(run / "params" / name, str(value))
    for name, value in {**dict.fromkeys(entry.tags, "true"), "mlflow.runName": f"{entry.name}/seed{seed}"}.items():
        _write(run / "tags" / name, value)
    if entry.note:
        _write(run / "tags" / "mlflow.note.content", entry.note)
    for split, scores in entry.scores.items():
        if position < len(scores):
            values = {"return": scores[position].mean(), "success": (scores[position] == task.SUCCESS).mean()}
            for name, value in values.items():
                _write(run / "metrics" / f"{split}.{name}", f"{stamp} {float(value)} 0\n")
    for name in ("return", "success"):
        points = entry.curves.get(seed, ())
        lines = [f"{stamp} {float(point[name])} {int(point['epoch'])}\n" for point in points]
        if lines:
            _write(run / "metrics" / f"val_curve.{name}", "".join(lines))
    for name, lines in _training(entry, seed, stamp).items():
        _write(run / "metrics" / f"train.{name}", "".join(lines))


def _training(entry: Entry, seed: int, stamp: int) -> dict[str, list[str]]:
    """The lines of each metric of a seed's training, a line for each epoch; raises DamagedFile."""
    lines: dict[str, list[str]] = defaultdict(list)
    folders = [folder for folder, seeds in loop.training_folders(entry.folder).items() if seed in seeds]
    for row in (row for folder in folders for row in metric_rows.read(folder) if row["seed"] == seed):
        for name in row.keys() - {"epoch", "seed"}:
            lines[name].append(f"{stamp} {float(row[name])} {row['epoch']}\n")
    return lines


def _write(file: Path, text: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")


def _yaml(values: Mapping[str, object]) -> str:
    """Values as YAML; JSON's texts and numbers are YAML too."""
    return "".join(f"{name}: {json.dumps(value)}\n" for name, value in values.items())
