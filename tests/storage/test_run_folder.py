"""Paths of run folders, written by hand."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dextron_bench.storage.run_folder import RunFolder, below, run_folders, seed_folders, source_folder

RUN = RunFolder.of(Path("runs"), "rlil-0.1", "real", 3)


def test_the_files_of_a_run_have_these_paths():
    folder = "runs/rlil-0.1/real/seed3"
    assert str(RUN.path) == folder
    assert str(RUN.config) == f"{folder}/config.json"
    assert str(RUN.provenance) == f"{folder}/provenance.json"
    assert str(RUN.weights) == f"{folder}/weights.safetensors"
    assert str(RUN.curve) == f"{folder}/curve.json"
    assert str(RUN.episodes) == f"{folder}/episodes.parquet"
    assert str(RUN.result) == f"{folder}/result.json"
    assert str(RUN.recordings) == f"{folder}/recordings"
    assert str(RUN.manifest) == f"{folder}/recordings.json"
    assert str(RUN.recording("unseen-reach", 7)) == f"{folder}/recordings/unseen-reach-0007.rrd"


def test_label_source_and_seed_are_those_of_the_path():
    assert (RUN.identity, RUN.label, RUN.seed) == ("rlil-0.1/real/seed3", "rlil-0.1", 3)
    assert RunFolder.of_seed(Path("bundle"), 12).seed == 12
    assert source_folder(Path("runs"), "rlil-0.1", "real") == RUN.path.parent


def test_the_identity_of_a_relative_path_is_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = tmp_path / "bc" / "real" / "seed0"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    assert RunFolder(Path(".")).identity == "bc/real/seed0"
    monkeypatch.chdir(folder.parent)
    assert RunFolder(Path("seed0")).label == "bc"
    os.symlink(folder, tmp_path / "link")
    assert RunFolder(tmp_path / "link").identity == "bc/real/seed0"


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """A folder of runs of `bc` and `exp`, with files and folders that are not runs."""
    for name in ("exp/real/seed0", "bc/synthetic/seed0", "bc/real/seed10", "bc/real/seed2", "bc/real/training-0+1"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "pairs").mkdir()
    (tmp_path / "bc" / "real" / "seed2" / "result.json").touch()
    (tmp_path / "exp" / "real" / "seed0" / "result.json").touch()
    return tmp_path


def test_run_folders_are_sorted_and_selected_by_label(runs: Path):
    names = ["bc/real/seed10", "bc/real/seed2", "bc/synthetic/seed0", "exp/real/seed0"]  # As text: 10 before 2.
    assert [run.identity for run in run_folders(runs)] == names
    assert [run.identity for run in run_folders(runs, "bc")] == names[:3]
    assert [run.seed for run in seed_folders(runs / "bc" / "real")] == [10, 2]
    assert run_folders(runs / "nothing") == []


def test_runs_below_a_place_are_those_with_the_file(runs: Path):
    assert [run.identity for run in below(runs, "result.json")] == ["bc/real/seed2", "exp/real/seed0"]
    assert [run.identity for run in below(runs / "bc" / "real" / "seed2", "result.json")] == ["bc/real/seed2"]
