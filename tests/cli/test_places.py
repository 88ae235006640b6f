"""A file that cannot be written: the line says what chooses another place, and says nothing else of other errors."""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass
from pathlib import Path

import pytest

from dextron_bench.cli.support import places


@dataclass(frozen=True)
class Command:
    """A command with two places."""

    runs: Path
    into: Path
    seed: int = 0


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """A command whose folders cannot be written; root could write them."""
    monkeypatch.setattr(os, "access", lambda path, mode: mode == os.R_OK)
    monkeypatch.setenv("DEXTRON_CACHE", str(tmp_path / "home/cache"))
    return Command(tmp_path / "runs", tmp_path / "runs/figures")


@pytest.mark.parametrize(
    ("file", "expected"),
    [
        ("runs/exp/a.json", "; --runs chooses another place"),
        ("runs/figures/a.png", "; --into chooses another place"),
        ("runs", "; --into chooses another place"),
        ("home/cache/real-reaches.npz", "; DEXTRON_CACHE names another folder"),
        ("home", "; DEXTRON_CACHE names another folder"),
        ("other/a.json", ""),
    ],
)
def test_the_flag_or_the_variable_is_named(tmp_path: Path, command: Command, file: str, expected: str):
    for number in (errno.EACCES, errno.EROFS, errno.EPERM):
        assert places.advice(OSError(number, "no", str(tmp_path / file)), command) == expected


def test_other_errors_get_no_advice(tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch):
    file = str(tmp_path / "runs/a.json")
    others = [OSError(errno.ENOSPC, "full", file), OSError(errno.EACCES, "no"), ValueError("no")]
    assert [places.advice(error, command) for error in others] == ["", "", ""]
    assert places.advice(OSError(errno.EACCES, "no", file), None) == ""
    monkeypatch.setattr(os, "access", lambda path, mode: True)
    assert places.advice(OSError(errno.EACCES, "no", file), command) == ""  # Its folder can be written.


def test_a_file_that_cannot_be_read_gets_no_advice(tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs/a.json").touch()
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert places.advice(OSError(errno.EACCES, "no", str(tmp_path / "runs/a.json")), command) == ""
