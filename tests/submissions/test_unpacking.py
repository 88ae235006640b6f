"""Bundles that are unpacked for viewing: one without episodes is named, and leaves nothing behind."""

from __future__ import annotations

import json
import zipfile
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import pytest

from dextron_bench.evaluation.declaration import Declaration
from dextron_bench.storage import hashing
from dextron_bench.submissions import bundle, unpacking


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    """A bundle whose manifest lists a seed, without its files."""
    manifest = {"format": 1, "name": "mine", "reaches": "synthetic", "seeds": [0], "files": {}, "physics": "0" * 64}
    manifest |= {"agent": {"kind": "method", "spec": "reflex", "settings": {}, "weights": ""}}
    with zipfile.ZipFile(tmp_path / "mine.zip", "w") as archive:
        archive.writestr(bundle.MANIFEST, json.dumps({**manifest, "declared": asdict(Declaration())}))
    return tmp_path / "mine.zip"


def test_a_bundle_without_the_episodes_of_a_seed_is_named(empty: Path, tmp_path: Path):
    with pytest.raises(bundle.BadBundle, match=r"mine\.zip lacks seed0/episodes\.parquet"):
        unpacking.unpack_for_viewing(empty, tmp_path / "runs")
    assert [place.name for place in (tmp_path / "runs").rglob("*")] == ["submissions", ".bundles"]


def test_what_is_no_file_is_refused(tmp_path: Path):
    with pytest.raises(bundle.BadBundle, match="is not a file"):
        unpacking.unpack_for_viewing(tmp_path, tmp_path / "runs")


def test_two_processes_may_unpack_one_bundle(empty: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The first to end gives the folder its name, and the other one takes that."""
    place = tmp_path / "runs" / unpacking.FOLDER / hashing.sha256(empty)[:16]

    def unpack(file: Path, part: Path) -> SimpleNamespace:
        for folder in (part, place):
            folder.mkdir()
            (folder / "bundle.json").touch()
        return SimpleNamespace(seeds=[], reaches="synthetic")

    monkeypatch.setattr(bundle, "unpack", unpack)
    assert unpacking.unpack_for_viewing(empty, tmp_path / "runs") == place
    assert [path.name for path in place.parent.iterdir()] == [place.name]
