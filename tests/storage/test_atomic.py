"""A file is complete or absent: a failed write leaves the old file, and a damaged JSON file is named."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.storage import atomic


def test_json_is_sorted_and_ends_with_a_newline(tmp_path: Path):
    atomic.write_json(tmp_path / "new" / "a.json", {"b": 1, "a": [2.5]})
    assert (tmp_path / "new" / "a.json").read_text() == '{\n "a": [\n  2.5\n ],\n "b": 1\n}\n'
    assert os.listdir(tmp_path / "new") == ["a.json"]


def test_numbers_that_json_cannot_hold_are_refused(tmp_path: Path):
    with pytest.raises((TypeError, ValueError)):
        atomic.write_json(tmp_path / "a.json", {"a": np.float32(1)})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("no")])
def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, error: BaseException):
    file = tmp_path / "a.txt"
    file.write_text("old")

    def fail(part: Path) -> None:
        part.write_text("half")
        raise error

    with pytest.raises(type(error)):
        atomic.write_atomically(file, fail)
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_the_file_appears_only_when_it_is_complete(tmp_path: Path):
    file = tmp_path / "a.txt"

    def write(part: Path) -> None:
        part.write_text("new")
        assert not file.exists()

    atomic.write_atomically(file, write)
    assert file.read_text() == "new"


def test_what_a_killed_write_left_is_removed_by_the_next_write_of_the_same_file(tmp_path: Path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    left, running, others = (f".a.txt.{ended.pid}.part", f".a.txt.{os.getppid()}.part", f".b.txt.{ended.pid}.part")
    for name in (left, running, others):
        (tmp_path / name).write_text("half")
    atomic.write_atomically(tmp_path / "a.txt", lambda part: part.write_text("new"))
    assert sorted(os.listdir(tmp_path)) == sorted(["a.txt", running, others])


def test_file_and_folder_are_synced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A rename is on the disk only when its folder is."""
    synced = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.append(os.readlink(f"/proc/self/fd/{descriptor}")))
    atomic.write_json(tmp_path / "a.json", {})
    assert synced == [str(tmp_path / f".a.json.{os.getpid()}.part"), str(tmp_path)]


def test_a_full_disk_names_the_file(tmp_path: Path):
    def fail(part: Path) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space") as caught:
        atomic.write_atomically(tmp_path / "a.txt", fail)
    assert caught.value.filename == str(tmp_path / "a.txt")


@pytest.mark.parametrize(
    ("text", "reason"),
    [("", "Expecting value"), ("[1]", "it does not hold a JSON object"), ("[" * 100_000, "recursion")],
)
def test_a_damaged_json_file_is_named_with_what_to_do(tmp_path: Path, text: str, reason: str):
    file = tmp_path / "a.json"
    file.write_text(text)
    with pytest.raises(atomic.DamagedFile) as caught:
        atomic.read_json(file)
    assert str(caught.value).startswith(f"{file} is damaged (")
    assert reason in str(caught.value)
    assert str(caught.value).endswith("); remove it and run again")
