"""A file is complete or absent: a failed write leaves the old file, and a damaged JSON file is named."""

from __future__ import annotations

import os
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
