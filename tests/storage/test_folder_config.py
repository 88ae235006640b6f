"""A folder belongs to one config: the first writer records it, and another config is refused with the difference."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.storage import folder_config, provenance
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.folder_config import FolderMismatch

CONFIG: dict[str, Any] = {"method": "bc", "seed": 0, "settings": {"rate": 0.1, "shape": (2, 3)}, "physics": "abc"}


@pytest.fixture(autouse=True)
def fixed_provenance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "collect", lambda physics: {"git": "1234", "physics": physics})


def test_the_first_call_writes_config_and_provenance(tmp_path: Path):
    folder_config.write_or_check(tmp_path / "run", CONFIG)
    assert json.loads((tmp_path / "run" / "config.json").read_text()) == json.loads(json.dumps(CONFIG))
    assert json.loads((tmp_path / "run" / "provenance.json").read_text()) == {"git": "1234", "physics": "abc"}


def test_an_equal_config_passes_and_changes_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder_config.write_or_check(tmp_path, CONFIG)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    monkeypatch.setattr(provenance, "collect", lambda physics: {"git": "5678"})
    folder_config.write_or_check(tmp_path, dict(reversed(CONFIG.items())))
    folder_config.check(tmp_path, CONFIG)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_defaults_are_stored_for_readers_and_not_compared(tmp_path: Path):
    """So a folder from before defaults were stored, and one whose code has other defaults, are the same run."""
    folder_config.write_or_check(tmp_path, CONFIG, {"near": 0.08})
    assert json.loads((tmp_path / "config.json").read_text())["defaults"] == {"near": 0.08}
    folder_config.write_or_check(tmp_path, CONFIG, {"near": 0.07})
    folder_config.write_or_check(tmp_path, CONFIG)


def test_a_folder_without_a_config_passes_the_check(tmp_path: Path):
    folder_config.check(tmp_path / "new", CONFIG)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"seed": 1}, "seed"),
        ({"settings": CONFIG["settings"] | {"rate": 0.2}}, r"settings \(rate\)"),
        ({"settings": {"shape": [2, 3]}}, r"settings \(rate\)"),
        ({"settings": CONFIG["settings"] | {"more": 1, "rate": 1.0}}, r"settings \(more, rate\)"),
        ({"settings": None}, "settings"),
        ({"seed": 1, "physics": "def"}, "seed and physics"),
    ],
)
def test_another_config_is_refused_and_the_differing_settings_are_named(
    tmp_path: Path, change: dict[str, Any], names: str
):
    folder_config.write_or_check(tmp_path, CONFIG)
    message = rf"{tmp_path} holds another run: it differs in {names}; remove it, or choose another folder with --runs$"
    for function in (folder_config.check, folder_config.write_or_check):
        with pytest.raises(FolderMismatch, match=message):
            function(tmp_path, CONFIG | change)


def test_another_kind_of_folder_has_its_own_file_and_advice(tmp_path: Path):
    file = tmp_path / "search.json"
    folder_config.write_or_check_file(file, {"seed": 0}, "search", "choose another --into")
    folder_config.write_or_check_file(file, {"seed": 0}, "search", "choose another --into")
    assert json.loads(file.read_text()) == {"seed": 0}
    with pytest.raises(FolderMismatch) as caught:
        folder_config.write_or_check_file(file, {"seed": 1}, "search", "choose another --into")
    assert str(caught.value) == f"{tmp_path} holds another search: it differs in seed; choose another --into"


def test_a_damaged_config_is_named(tmp_path: Path):
    (tmp_path / "config.json").write_text("{")
    with pytest.raises(DamagedFile, match=r"config\.json is damaged"):
        folder_config.check(tmp_path, CONFIG)
