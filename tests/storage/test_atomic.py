"""A file is complete or absent: a failed write leaves the old file, and a damaged JSON file is named."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.storage import atomic

DAY = 24 * 3600.0  # [s]


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


def test_what_a_killed_write_left_is_removed_a_day_later_by_the_next_write_of_the_same_file(tmp_path: Path):
    """By the clock of the file system: processes in other containers have the same numbers, and other machines other
    clocks."""
    now = tmp_path.stat().st_mtime
    ages = {".a.txt.1.part": 2 * DAY, ".a.txt.4f2c.part": DAY - 60.0, ".b.txt.1.part": 2 * DAY}
    for name, age in ages.items():
        (tmp_path / name).write_text("half")
        os.utime(tmp_path / name, (now - age, now - age))
    atomic.write_atomically(tmp_path / "a.txt", lambda part: part.write_text("new"))
    assert sorted(os.listdir(tmp_path)) == [".a.txt.4f2c.part", ".b.txt.1.part", "a.txt"]


def test_two_writers_of_one_file_never_share_a_temporary_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Two containers are both process 1."""
    monkeypatch.setattr(os, "getpid", lambda: 1)

    def write(part: Path) -> None:
        part.write_text("first")
        atomic.write_atomically(tmp_path / "a.txt", lambda other: other.write_text("second"))
        assert part.read_text() == "first"

    atomic.write_atomically(tmp_path / "a.txt", write)
    assert (tmp_path / "a.txt").read_text() == "first"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_file_and_folder_are_synced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A rename is on the disk only when its folder is."""
    synced = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.append(os.readlink(f"/proc/self/fd/{descriptor}")))
    monkeypatch.setattr(secrets, "token_hex", lambda size: "5a5a")
    atomic.write_json(tmp_path / "a.json", {})
    assert synced == [str(tmp_path / ".a.json.5a5a.part"), str(tmp_path)]


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP, errno.EBADF, errno.EROFS])
def test_a_file_system_without_fsync_is_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int):
    def refuse(descriptor: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", refuse)
    for value in (1, 2):
        atomic.write_json(tmp_path / "a.json", {"a": value})
    assert atomic.read_json(tmp_path / "a.json") == {"a": 2}


@pytest.mark.parametrize("number", [errno.EIO, errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("failing", ["file", "folder"])
def test_a_fault_of_the_disk_is_never_hidden(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, failing: str
):
    def fail(descriptor: int) -> None:
        if stat.S_ISDIR(os.fstat(descriptor).st_mode) == (failing == "folder"):
            raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match=os.strerror(number)) as caught:
        atomic.write_json(tmp_path / "a.json", {})
    assert caught.value.filename == str(tmp_path / "a.json")


@pytest.mark.parametrize("links", [True, False])
def test_a_file_is_created_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool):
    if not links:
        monkeypatch.setattr(os, "link", refuse_link)
    atomic.create_json(tmp_path / "a.json", {"a": 1})
    with pytest.raises(FileExistsError):
        atomic.create_json(tmp_path / "a.json", {"a": 2})
    assert atomic.read_json(tmp_path / "a.json") == {"a": 1}
    assert os.listdir(tmp_path) == ["a.json"]


def test_a_link_whose_answer_was_lost_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """NFS may repeat a call that has succeeded."""
    link = os.link

    def twice(source: Path, target: Path) -> None:
        link(source, target)
        link(source, target)

    monkeypatch.setattr(os, "link", twice)
    atomic.create_json(tmp_path / "a.json", {"a": 1})
    assert os.listdir(tmp_path) == ["a.json"]


def refuse_link(source: Path, target: Path) -> None:
    raise OSError(errno.EPERM, os.strerror(errno.EPERM))


def test_an_error_of_the_temporary_file_names_the_file(tmp_path: Path):
    def fail(part: Path) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(part))

    with pytest.raises(PermissionError) as caught:
        atomic.write_atomically(tmp_path / "a.txt", fail)
    assert caught.value.filename == str(tmp_path / "a.txt")


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
