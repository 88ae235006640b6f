"""Writes runs into a database of MLflow, with MLflow's own client. Its only importer."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from dextron_bench.catalogue.exported_runs import RUNNING, ExportedRun
from dextron_bench.errors import BadInput, Failed
from dextron_bench.storage import folders, home
from dextron_bench.storage.folders import visible

EXPERIMENT = "dextron-bench"
DATABASE = "mlflow.db"  # `mlflow ui` opens a file of this name in its working folder.
NEEDED = ("mlflow", "sqlalchemy", "alembic")  # The packages of the extra `mlflow`.
MOST = 50  # Parameters of a run, and tags, that the client takes at once; of metrics ten times as many.
UNKNOWN = 1  # [ms since 1970] MLflow puts the present in the place of a begin that is missing or 0.
FORBIDDEN = re.compile(r"[^/\w.\- :]")  # In the names of MLflow; a split under a track has a +.


class NoMlflow(BadInput):
    """MLflow's client is not installed."""

    def __init__(self) -> None:
        super().__init__("an export for MLflow needs its client: `pip install 'dextron-bench[mlflow]'`")


def write(runs: Iterable[ExportedRun], folder: Path) -> None:
    """Writes runs into a database in a new or empty folder, which holds all of it or nothing.

    Raises BadInput, NoMlflow, Failed, OSError.
    """
    if visible(folder, "*"):
        raise BadInput(f"{folder} is not empty; choose another folder with --into")
    if any(find_spec(name) is None for name in NEEDED):
        raise NoMlflow
    with folders.replacing(folder) as part, home.lent():
        _write_database(runs, part / DATABASE, (folder.resolve() / "artifacts").as_uri())


def _write_database(runs: Iterable[ExportedRun], database: Path, artifacts: str) -> None:
    """Writes runs into a new database, and reports nothing to anybody; raises Failed."""
    os.environ |= {"MLFLOW_DISABLE_TELEMETRY": "true", "MLFLOW_LOGGING_LEVEL": "WARNING"}
    from mlflow.exceptions import MlflowException  # pyright: ignore[reportMissingImports]  # Of an extra.
    from mlflow.tracking import MlflowClient  # pyright: ignore[reportMissingImports]

    try:
        client = MlflowClient(f"sqlite:///{database}")
        experiment = client.create_experiment(EXPERIMENT, artifacts)
        for run in runs:
            _write_run(client, experiment, run)
    except MlflowException as error:  # Of a full disk, for example.
        raise Failed(f"MLflow's client cannot write the export: {str(error).splitlines()[0]}") from error


def _write_run(client: Any, experiment: str, run: ExportedRun) -> None:
    """Writes a run; the times of its metrics are the time of its end, or of its begin."""
    from mlflow import entities  # pyright: ignore[reportMissingImports]

    began, ended = _milliseconds(run.times.began), _milliseconds(run.times.ended)
    number = client.create_run(experiment, start_time=began or UNKNOWN, run_name=run.name).info.run_id
    stamp = ended or began or UNKNOWN
    metrics = [entities.Metric(_name(one.name), one.value, stamp, one.step) for one in run.metrics]
    for start in range(0, len(metrics), 10 * MOST):
        client.log_batch(number, metrics=metrics[start : start + 10 * MOST])
    params = [entities.Param(_name(name), value) for name, value in run.params.items()]
    tags = [entities.RunTag(_name(name), value) for name, value in run.tags.items()]
    for start in range(0, max(len(params), len(tags)), MOST):
        part = slice(start, start + MOST)
        client.log_batch(number, params=params[part], tags=tags[part])
    if run.state == RUNNING:  # As it is when it is created.
        return
    if ended is None:
        client.update_run(number, status=run.state)
    else:
        client.set_terminated(number, run.state, ended)


def _name(name: str) -> str:
    """A name with the characters that MLflow allows."""
    return FORBIDDEN.sub("_", name.replace("+", "/"))


def _milliseconds(moment: datetime | None) -> int | None:
    return None if moment is None else int(moment.timestamp() * 1000)
