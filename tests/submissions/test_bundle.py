"""Bundles from strangers: paths, kinds, links, sizes and hashes that a valid bundle never has are refused."""

from __future__ import annotations

import json
import os
import shutil
import stat
import warnings
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.submissions import bundle, entry
from dextron_bench.submissions.declaration import Declaration
from tests.helpers import tiny_benchmark
from tests.helpers.forged_bundles import entry_of


class Unsafe:
    """A valid bundle, to which a test adds unsafe members."""

    def __init__(self, valid: Path, file: Path) -> None:
        with zipfile.ZipFile(valid) as archive:
            self.members = [(info, archive.read(info)) for info in archive.infolist()]
        self.file = file

    def add(self, name: str | zipfile.ZipInfo, content: bytes = b"") -> Unsafe:
        info = name if isinstance(name, zipfile.ZipInfo) else zipfile.ZipInfo(name)
        info.compress_type = zipfile.ZIP_DEFLATED
        self.members.append((info, content))
        return self

    def refused(self, into: Path) -> str:
        """The reason of the refusal; asserts that nothing was written outside the folder `into`."""
        with zipfile.ZipFile(self.file, "w") as archive, warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Duplicate name")
            for info, content in self.members:
                archive.writestr(info, content)
        before = sorted(into.parent.rglob("*"))
        with pytest.raises(bundle.BadBundle) as caught:
            bundle.unpack(self.file, into)
        assert [path for path in sorted(into.parent.rglob("*")) if not path.is_relative_to(into)] == before
        return str(caught.value)


@pytest.fixture
def unsafe(submitted: Path, tmp_path: Path) -> Unsafe:
    return Unsafe(submitted / "near.zip", tmp_path / "unsafe.zip")


@pytest.mark.parametrize(
    "name",
    [
        "../evil.py",
        "/etc/passwd",
        "agent/../../evil.py",
        "agent\\evil.py",
        "agent/weights.pkl",
        "seed0/x.parquet",
        "C:x",
    ],
)
def test_paths_and_kinds_that_a_bundle_cannot_hold_are_refused(name: str, unsafe: Unsafe, tmp_path: Path):
    assert f"a bundle cannot hold a file {name!r}" in unsafe.add(name, b"x").refused(tmp_path / "into")


def test_a_compression_method_without_a_size_limit_is_refused(unsafe: Unsafe, tmp_path: Path):
    unsafe.add("agent/zeros.pt", bytes(2**20))
    unsafe.members[-1][0].compress_type = zipfile.ZIP_BZIP2
    assert "uses a compression method whose output size cannot be limited" in unsafe.refused(tmp_path / "into")


def test_links_duplicates_and_unlisted_files_are_refused(submitted: Path, unsafe: Unsafe, tmp_path: Path):
    link = zipfile.ZipInfo("agent/link.py")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    assert "is a link" in unsafe.add(link, b"/etc/passwd").refused(tmp_path / "into")
    duplicate = Unsafe(submitted / "near.zip", unsafe.file).add("seed0/result.json", b"{}")
    assert "holds seed0/result.json twice" in duplicate.refused(tmp_path / "into")
    unlisted = Unsafe(submitted / "near.zip", unsafe.file).add("agent/more.py", b"")
    assert "holds agent/more.py, which its manifest does not list" in unlisted.refused(tmp_path / "into")


@pytest.mark.slow
def test_a_zip_bomb_is_refused_before_it_is_unpacked(unsafe: Unsafe, tmp_path: Path):
    bomb = unsafe.add("agent/zeros.pt", bytes(bundle.LARGEST + 1))
    assert "agent/zeros.pt is too large when unpacked (256 MiB)" in bomb.refused(tmp_path / "into")
    assert bomb.file.stat().st_size < 2**21


def test_a_zip_bomb_of_many_files_is_refused(unsafe: Unsafe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(bundle, "TOTAL", 1000)
    assert "would unpack to more than" in unsafe.refused(tmp_path / "into")


def test_a_changed_byte_is_refused(submitted: Path, unsafe: Unsafe, tmp_path: Path):
    for place, (info, content) in enumerate(unsafe.members):
        if info.filename == "seed0/result.json":
            unsafe.members[place] = (info, content.replace(b"20.0", b"19.0", 1))
    assert "seed0/result.json has another SHA-256 than the manifest lists" in unsafe.refused(tmp_path / "into")
    cut = tmp_path / "cut.zip"
    cut.write_bytes((submitted / "near.zip").read_bytes()[:-30])
    with pytest.raises(bundle.BadBundle, match="not a complete zip file"):
        bundle.unpack(cut, tmp_path / "other")


def test_only_files_of_the_entered_seeds_are_packed(submitted: Path, tmp_path: Path):
    """An interrupted write leaves a partial file, and a seed that was played need not be submitted."""
    folder = submitted / "runs" / entry.FOLDER / "near" / tiny_benchmark.NAME
    shutil.copytree(folder, tmp_path / "near")
    (tmp_path / "near/seed0/.episodes.parquet.77.part").touch()
    manifest = entry_of(submitted, (0,)).manifest()
    names = bundle.pack(tmp_path / "near", manifest, {}, tmp_path / "near.zip")["files"]
    assert {name.split("/")[0] for name in names} == {"seed0"}
    assert not [name for name in names if "part" in name]


def test_an_agents_file_that_a_bundle_cannot_hold_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file = tmp_path / "_mine.py"
    file.touch()
    with pytest.raises(bundle.BadBundle, match=r"a bundle cannot hold a file 'agent/_mine\.py'"):
        bundle.check_agent({file.name: file})
    monkeypatch.setattr(bundle, "LARGEST", -1)
    with pytest.raises(bundle.BadBundle, match="is larger than"):
        bundle.check_agent({"mine.py": file})


@pytest.mark.parametrize("hours", [float("nan"), float("inf"), 10**400, -1])
def test_declared_hours_must_be_a_finite_number(hours: float, submitted: Path):
    with zipfile.ZipFile(submitted / "near.zip") as archive:
        manifest = json.loads(archive.read(bundle.MANIFEST))
    bundle.check(manifest, "bundle", Path("near.zip"))
    manifest["declared"]["hours"] = hours
    with pytest.raises(bundle.BadBundle):
        bundle.check(manifest, "bundle", Path("near.zip"))


def test_a_zip_file_that_is_not_a_bundle_is_refused(tmp_path: Path):
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("bundle.json", '{"format": 1}')
    with pytest.raises(bundle.BadBundle, match="'name' is a required property"):
        bundle.unpack(tmp_path / "other.zip", tmp_path / "into")


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"name": "mine\n"}, "has the character '\\n'"),
        ({"declared": {"notes": "\x1b[2J"}}, "has the character '\\x1b'"),
        ({"declared": {"authors": "a\u202eb"}}, "has the character '\\u202e'"),
        ({"agent": {"settings": {"a\u2066": 1}}}, "has the character '\\u2066'"),
        ({"seeds": list(range(100))}, "has 100 seeds; a submission has at most 10"),
    ],
)
def test_text_that_cannot_be_printed_and_many_seeds_are_refused(changes: dict[str, Any], why: str):
    value: dict[str, Any] = {"format": 1, "name": "mine", "reaches": "synthetic", "seeds": [0], "files": {}}
    value |= {"agent": {"kind": "method", "spec": "reflex", "settings": {}, "weights": ""}, "physics": "0" * 64}
    value |= {"declared": asdict(Declaration())}
    bundle.check(value, "bundle", Path("mine.zip"))
    for name, new in changes.items():
        value[name] = value[name] | new if isinstance(new, dict) else new
    with pytest.raises(bundle.BadBundle) as caught:
        bundle.check(value, "bundle", Path("mine.zip"))
    assert why in str(caught.value)


def test_json_is_limited_before_it_is_parsed(unsafe: Unsafe, tmp_path: Path):
    big = unsafe.add("seed7/result.json", b" " * (bundle.LARGEST_JSON + 1))
    assert "seed7/result.json is too large" in big.refused(tmp_path / "opened")
    with pytest.raises(bundle.BadBundle, match="is larger than 4 MiB"):
        bundle.parse(b" " * (bundle.LARGEST_JSON + 1), "result", tmp_path / "result.json")


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"[" * 100_000, b'{"seed": ' + b"9" * 5000 + b"}", b"\xff", b"{} {}", b"[NaN]"])
def test_json_that_harms_its_reader_is_refused(content: bytes, tmp_path: Path):
    with pytest.raises(bundle.BadBundle, match=r"mine\.json"):
        bundle.parse(content, "bundle", Path("mine.json"))


@pytest.mark.slow
def test_a_check_of_json_that_takes_too_long_is_refused(monkeypatch: pytest.MonkeyPatch):
    """A million seeds: the schema looks at each of them."""
    monkeypatch.setattr(bundle, "SECONDS", 3.0)
    with pytest.raises(bundle.BadBundle, match="the process that read it took too long"):
        bundle.parse(b'{"seeds": [' + b"0," * 1_900_000 + b"0]}", "bundle", Path("mine.json"))


def test_a_pipe_is_refused_at_once(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe.zip")
    with pytest.raises(bundle.BadBundle, match=r"pipe\.zip is not a regular file"):
        bundle.unpack(tmp_path / "pipe.zip", tmp_path / "opened")


@pytest.mark.parametrize(("place", "number"), [(12, 1_000_000), (16, 2**31), (16, 60)])
def test_an_end_that_points_before_the_file_is_refused_by_name(place: int, number: int, tmp_path: Path):
    """Size or position of the list of files; a reader that follows it seeks to a negative position."""
    file = tmp_path / "mine.zip"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("bundle.json", b"")
    content, end = bytearray(file.read_bytes()), file.stat().st_size - 22
    content[end + place : end + place + 4] = number.to_bytes(4, "little")
    file.write_bytes(content)
    with pytest.raises(bundle.BadBundle, match=r"mine\.zip is not a complete zip file"):
        bundle.unpack(file, tmp_path / "opened")


def test_a_long_list_of_files_is_refused_before_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file = tmp_path / "many.zip"
    with zipfile.ZipFile(file, "w") as archive:
        for number in range(2000):
            archive.writestr(f"agent/{number}.py", b"")
    content = file.read_bytes()
    file.write_bytes(content[:-6] + b"PK\5\6" + content[-2:])  # A second mark, inside the record.
    monkeypatch.setattr(bundle, "LARGEST_DIRECTORY", 100_000)
    monkeypatch.setattr(zipfile, "ZipFile", None)
    with pytest.raises(bundle.BadBundle, match="lists more files than the 20000"):
        bundle.unpack(file, tmp_path / "opened")
