"""A folder belongs to one config: the first writer records it, and another config is refused with the difference."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.storage import folder_config, provenance
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.folder_config import FolderMismatch
from tests.helpers import conditions

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


WRITER = """
import sys
from pathlib import Path
from dextron_bench.storage import folder_config, provenance
provenance.collect = lambda physics: {"git": "1234"}
folder, seed = Path(sys.argv[1]), int(sys.argv[2])
for line in sys.stdin:
    try:
        folder_config.write_or_check(folder / line.strip(), {"seed": seed, "physics": "abc"})
        print("agrees", flush=True)
    except folder_config.FolderMismatch:
        print("differs", flush=True)
"""


def simultaneous(folder: Path, seeds: Sequence[int], *names: str) -> list[list[str]]:
    """The answers of processes that write a config of their seed to thirty folders, each folder at the same time."""
    with ExitStack() as stack:
        writers = [
            stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", WRITER, str(folder), str(seed)],
                    env=conditions.environment(*names),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    text=True,
                )
            )
            for seed in seeds
        ]
        answers = []
        for number in range(30):
            for writer in writers:
                assert writer.stdin is not None
                writer.stdin.write(f"{number}\n")
                writer.stdin.flush()
            answers.append([writer.stdout.readline().strip() for writer in writers if writer.stdout is not None])
        return answers


@pytest.mark.slow
@pytest.mark.parametrize("names", [("process_one",), ("process_one", "no_links")], ids="+".join)
def test_processes_with_one_number_write_one_config(tmp_path: Path, names: tuple[str, ...]):
    """Two containers that share a folder are both process 1; none loses a temporary file to the other one."""
    assert simultaneous(tmp_path, (0, 0, 0, 0), *names) == [["agrees"] * 4] * 30
    for number in range(30):
        assert sorted(os.listdir(tmp_path / str(number))) == ["config.json", "provenance.json", "times.json"]


@pytest.mark.slow
@pytest.mark.parametrize("names", [("process_one",), ("process_one", "no_links")], ids="+".join)
def test_of_two_configs_written_at_the_same_time_one_wins_and_the_other_is_refused(
    tmp_path: Path, names: tuple[str, ...]
):
    for number, answers in enumerate(simultaneous(tmp_path, (0, 1), *names)):
        winner = json.loads((tmp_path / str(number) / "config.json").read_text())["seed"]
        assert answers == [["agrees", "differs"], ["differs", "agrees"]][winner]


def test_a_writer_that_was_killed_after_its_config_leaves_a_folder_that_goes_on(tmp_path: Path):
    folder_config.write_or_check(tmp_path, CONFIG)
    (tmp_path / "provenance.json").unlink()
    folder_config.write_or_check(tmp_path, CONFIG)
    assert json.loads((tmp_path / "provenance.json").read_text())["git"] == "1234"


def test_a_config_that_is_empty_for_a_moment_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Where the file system has no links, its name is taken before it has its content."""
    file = tmp_path / "config.json"
    file.touch()
    monkeypatch.setattr(folder_config.time, "sleep", lambda seconds: file.write_text(json.dumps(CONFIG)))
    folder_config.write_or_check(tmp_path, CONFIG)
