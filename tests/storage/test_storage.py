"""What a file says of its making, digests, and files that are whole or not there."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.storage import atomic, hashing, provenance
from dextron_bench.world import model


def test_what_is_collected_is_plain_and_names_what_matters():
    found = provenance.collect(model.mjcf_hash())
    assert json.loads(json.dumps(found)) == found
    assert {"git", "dirty", "versions", "python", "machine", "physics"} <= set(found)
    assert found["versions"]["mujoco"].startswith("3.")
    assert found["physics"] == model.mjcf_hash()
    assert found["machine"]["cores"] >= 1


def test_a_package_that_is_not_there_has_no_version():
    assert provenance._version("nosuchpackage") is None


def test_without_git_the_commit_is_unknown(monkeypatch: pytest.MonkeyPatch):
    def missing(*_: object, **__: object) -> None:
        raise FileNotFoundError("git")

    monkeypatch.setattr(subprocess, "run", missing)
    assert provenance._git("rev-parse", "HEAD") is None


def test_a_digest_tells_where_parts_end():
    by_hand = hashlib.sha256(b"\x02" + bytes(7) + b"ab" + b"\x01" + bytes(7) + b"c").hexdigest()
    assert hashing.digest(b"ab", b"c") == by_hand
    assert hashing.digest(b"a", b"bc") != by_hand
    assert hashing.digest(b"abc") != by_hand


def test_json_is_sorted_and_ends_with_a_newline(tmp_path: Path):
    atomic.write_json(tmp_path / "new" / "a.json", {"b": 1, "a": [2.5]})
    assert (tmp_path / "new" / "a.json").read_text() == '{\n "a": [\n  2.5\n ],\n "b": 1\n}\n'
    assert os.listdir(tmp_path / "new") == ["a.json"]


def test_numbers_that_json_has_no_word_for_are_no_json(tmp_path: Path):
    with pytest.raises((TypeError, ValueError)):
        atomic.write_json(tmp_path / "a.json", {"a": np.float32(1)})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("no")])
def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path, error: BaseException):
    file = tmp_path / "a.txt"
    file.write_text("old")

    def fail(part: Path) -> None:
        part.write_text("half")
        raise error

    with pytest.raises(type(error)):
        atomic.write_atomically(file, fail)
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_the_file_appears_only_when_it_is_whole(tmp_path: Path):
    file = tmp_path / "a.txt"

    def write(part: Path) -> None:
        part.write_text("new")
        assert not file.exists()

    atomic.write_atomically(file, write)
    assert file.read_text() == "new"
