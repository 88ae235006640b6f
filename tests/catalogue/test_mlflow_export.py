"""MLflow reads what its client has written, and an export is whole or absent."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.catalogue import mlflow_export
from dextron_bench.catalogue.exported_runs import ExportedRun, Metric
from dextron_bench.storage.run_times import RunTimes

BEGAN, ENDED = datetime(2026, 1, 1, 1, tzinfo=UTC), datetime(2026, 1, 1, 2, tzinfo=UTC)
DONE = ExportedRun(
    "mine/real/seed0",
    "FINISHED",
    RunTimes(BEGAN, ENDED),
    {f"setting{number}": str(number) for number in range(120)},
    {"good": "true", "mlflow.note.content": "two\nlines"},
    [Metric("test+delay-100.return", 15.0), *(Metric("train.loss", 1 / epoch, epoch) for epoch in range(1, 1201))],
)
OTHERS = [
    ExportedRun("going/real/seed0", "RUNNING", RunTimes(BEGAN, ENDED)),
    ExportedRun("killed/real/seed0", "KILLED", RunTimes(BEGAN)),
    ExportedRun("failed/real/seed0", "FAILED", RunTimes(BEGAN, ENDED)),
    ExportedRun("old/real/seed0", "FINISHED", RunTimes()),
]


@pytest.fixture
def needs_mlflow() -> None:
    for package in mlflow_export.NEEDED:
        pytest.importorskip(package, reason=f"{package} of the extra `mlflow` is not installed")


@pytest.fixture
def read(tmp_path: Path, needs_mlflow: None) -> dict[str, Any]:
    """Runs as MLflow reads them, by name, of an export that was moved."""
    from mlflow.tracking import MlflowClient  # pyright: ignore[reportMissingImports]

    mlflow_export.write([DONE, *OTHERS], tmp_path / "new/exported")
    assert os.listdir(tmp_path / "new") == ["exported"]
    assert os.listdir(tmp_path / "new/exported") == ["mlflow.db"]
    (tmp_path / "new").rename(tmp_path / "moved")
    client = MlflowClient(f"sqlite:///{tmp_path}/moved/exported/mlflow.db")
    [experiment] = [one for one in client.search_experiments() if one.name == mlflow_export.EXPERIMENT]
    runs: dict[str, Any] = {run.info.run_name or "": run for run in client.search_runs([experiment.experiment_id])}
    history = client.get_metric_history(runs[DONE.name].info.run_id, "train.loss")
    runs["history"] = [(point.step, point.value) for point in history]
    return runs


@pytest.mark.slow
def test_mlflow_reads_settings_scores_curves_and_tags(read: dict[str, Any]):
    done = read[DONE.name].data
    assert done.params == DONE.params
    assert done.tags["mlflow.note.content"] == "two\nlines"
    assert done.metrics["test/delay-100.return"] == 15.0
    assert sorted(read["history"]) == [(epoch, 1 / epoch) for epoch in range(1, 1201)]


@pytest.mark.slow
def test_mlflow_reads_states_and_times(read: dict[str, Any]):
    infos = {name.partition("/")[0]: read[name].info for name in (DONE.name, *(run.name for run in OTHERS))}
    began, ended = 1767229200000, 1767232800000  # 1:00 and 2:00 on 2026-01-01, in milliseconds.
    assert {name: (info.status, info.start_time, info.end_time) for name, info in infos.items()} == {
        "mine": ("FINISHED", began, ended),
        "going": ("RUNNING", began, None),
        "killed": ("KILLED", began, None),
        "failed": ("FAILED", began, ended),
        "old": ("FINISHED", 1, None),  # In 1970: not known.
    }


@pytest.mark.slow
@pytest.mark.usefixtures("needs_mlflow")
def test_an_export_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(mlflow_export, "_write_run", fail)
    with pytest.raises(OSError, match="No space left"):
        mlflow_export.write([DONE], tmp_path / "new/exported")
    assert os.listdir(tmp_path / "new") == []


@pytest.mark.slow
@pytest.mark.usefixtures("needs_mlflow")
def test_a_value_that_mlflow_refuses_is_one_error(tmp_path: Path):
    refused = ExportedRun("a", "FINISHED", RunTimes(), metrics=[Metric("a/../b", 1.0)])
    with pytest.raises(mlflow_export.NotWritten, match=r"cannot write the export: .*a/\.\./b"):
        mlflow_export.write([refused], tmp_path / "exported")


def test_a_folder_that_holds_something_is_refused(tmp_path: Path):
    (tmp_path / "exported").mkdir()
    (tmp_path / "exported/mine").touch()
    with pytest.raises(mlflow_export.NotEmpty, match="exported is not empty; choose another folder with --into"):
        mlflow_export.write([DONE], tmp_path / "exported")


def test_a_missing_client_is_named_with_the_command_that_installs_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(mlflow_export, "find_spec", lambda name: None)
    with pytest.raises(mlflow_export.NoMlflow, match=r"`pip install 'dextron-bench\[mlflow\]'`"):
        mlflow_export.write([DONE], tmp_path / "exported")
