"""The package that would be published: the wheel, built from the source distribution, runs from any folder."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from email.parser import HeaderParser
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("dextron_bench", "baselines")
CONTAINER_FILE = ROOT / "Containerfile"
BUILDERS = ("docker", "podman")

pytestmark = pytest.mark.slow


def run(*words: str, folder: Path, environment: Mapping[str, str] | None = None) -> str:
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=os.environ | (environment or {}), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    run("-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT), folder=folder)
    assert len([*folder.glob("*.tar.gz")]) == 1
    return next(folder.glob("*.whl"))


def test_the_wheel_holds_every_file_of_the_packages_and_the_published_results(wheel: Path):
    held = {name for name in ZipFile(wheel).namelist() if ".dist-info/" not in name}
    files = {
        file.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for file in (ROOT / package).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    results = {
        file.relative_to(ROOT / "leaderboard").as_posix() for file in ROOT.glob("leaderboard/results/*/*/*/*.json")
    }
    assert held == files | {f"dextron_bench/data/{name}" for name in results}


def test_its_metadata_say_what_a_reader_of_the_index_needs(wheel: Path):
    archive = ZipFile(wheel)
    [name] = [name for name in archive.namelist() if name.endswith("/METADATA")]
    metadata = HeaderParser().parsestr(archive.read(name).decode())
    assert metadata["Name"] == "dextron-bench"
    assert metadata["License-Expression"] == "BSD-2-Clause"
    assert metadata["Requires-Python"] == ">=3.11"
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert "Quick start" in metadata.get_payload()
    assert {"minari", "video", "onnx"} <= set(metadata.get_all("Provides-Extra", []))
    assert not any("://" in value for key, value in metadata.items() if key != "Description")


def test_the_wheel_runs_without_the_checkout(wheel: Path, tmp_path: Path):
    installed, elsewhere = tmp_path / "installed", tmp_path / "elsewhere"
    elsewhere.mkdir()
    install = ("-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", str(installed), str(wheel))
    run(*install, folder=elsewhere)
    environment = {"PYTHONPATH": str(installed)}
    place = run("-c", "import dextron_bench; print(dextron_bench.__file__)", folder=elsewhere, environment=environment)
    assert Path(place.strip()).is_relative_to(installed)
    dextron_bench = ("-m", "dextron_bench")
    assert "reflex" in run(*dextron_bench, "runs", "methods", folder=elsewhere, environment=environment)
    words = ("run", "--method", "nothing", "--split", "val", "--record", "0", "--quiet")
    assert "nothing" in run(*dextron_bench, *words, folder=elsewhere, environment=environment)
    assert (elsewhere / "runs/nothing/synthetic/seed0/result.json").exists()


def test_the_container_file_has_the_tested_version_of_pytorch_and_renders_without_a_gpu():
    text, tested = CONTAINER_FILE.read_text(), (ROOT / "constraints.txt").read_text().splitlines()
    assert set(re.findall(r"torch==[\d.]+", text)) & set(tested)
    assert "-c /src/constraints.txt" in text
    assert "libosmesa6" in text
    assert "MUJOCO_GL=osmesa" in text
    ignored = (ROOT / ".dockerignore").read_text().split()
    assert {"runs", "dextron-*.zip", "real-reaches*.npz"} <= set(ignored)  # No image may hold the recorded reaches.


def test_the_image_of_the_container_file_runs_an_agent():
    builder = next((name for name in BUILDERS if shutil.which(name) and _works(name)), None)
    if builder is None:
        pytest.skip(f"no engine of {' or '.join(BUILDERS)} runs here")
    build = [builder, "build", "--quiet", "--tag", "dextron-bench-test", "--file", str(CONTAINER_FILE), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    words = ("run", "--method", "nothing", "--split", "val", "--record", "1", "--quiet", "--json")
    done = subprocess.run([builder, "run", "--rm", "dextron-bench-test", *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert '"nothing"' in done.stdout


def _works(builder: str) -> bool:
    """True if the engine behind a builder answers; some machines have its client alone."""
    return subprocess.run([builder, "info"], capture_output=True).returncode == 0
