"""Releases in folders and zip files: valid, damaged and malicious ones."""

from __future__ import annotations

import stat
import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from dextron_bench.errors import BadInput
from dextron_bench.reaches.recorded import cache as recorded_cache
from dextron_bench.reaches.recorded.release import MAX_FILE, Manifest
from dextron_bench.reaches.recorded.release import read as read_release
from tests.helpers.small_release import NAMES, SmallRelease

FILE = "extracts/01_fl_06.json"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty cache for each test."""
    monkeypatch.setenv("DEXTRON_CACHE", str(tmp_path / "cache"))


def test_the_shipped_manifest_names_every_recording():
    manifest = Manifest.load()
    names = manifest.reaches
    assert len(names) == 575 == len(manifest.files) / 2
    assert names == sorted(names)
    assert {file for name in names for file in (f"extracts/{name}.json", f"extracts/meta/{name}_meta.json")} == set(
        manifest.files
    )
    assert sum(name.startswith("09_") for name in names) == 63  # Subject 09 misses one of 64.


@pytest.mark.parametrize("folder", ["", "data", "data/extracts", ".."])
def test_a_folder_may_be_given_at_any_level(small_release: SmallRelease, folder: str):
    reaches = read_release(small_release.unpacked() / folder, Manifest.load(small_release.manifest))
    assert [reach.name for reach in reaches] == list(NAMES)


@pytest.mark.parametrize("top", ["dextron-abc/data/", "data/", ""])
def test_a_zip_may_have_any_top_folder(small_release: SmallRelease, top: str):
    manifest = Manifest.load(small_release.manifest)
    assert [reach.name for reach in read_release(small_release.zip(top=top), manifest)] == list(NAMES)


def import_error(location: Path, small_release: SmallRelease) -> str:
    with pytest.raises(BadInput) as caught:
        recorded_cache.import_release(location, Manifest.load(small_release.manifest))
    assert not recorded_cache.cache_file().exists()
    return str(caught.value)


def test_the_error_for_a_changed_value_is_about_the_hash(small_release: SmallRelease):
    file = small_release.zip({FILE: small_release.files[FILE].replace(b"-0.5", b"-0.6")})
    assert import_error(file, small_release).startswith(f"{FILE}: its SHA-256 is not the published one")


def test_the_error_for_a_truncated_file_names_its_line(small_release: SmallRelease):
    assert import_error(small_release.zip({FILE: small_release.files[FILE][:-9]}), small_release).startswith(
        f"{FILE}: line 6: "
    )


def test_the_error_for_a_missing_file_names_it(small_release: SmallRelease):
    top = small_release.unpacked()
    (top / "data" / FILE).unlink()
    assert f"lacks 1 of 6 files, first {FILE}" in import_error(top, small_release)


def test_a_truncated_zip_is_refused(small_release: SmallRelease):
    file = small_release.zip()
    file.write_bytes(file.read_bytes()[:-40])
    assert "is not a valid zip file" in import_error(file, small_release)


def test_the_error_for_damaged_bytes_in_the_zip_names_the_file(small_release: SmallRelease):
    file = small_release.zip()
    content = bytearray(file.read_bytes())
    with zipfile.ZipFile(file) as archive:
        start = archive.getinfo("dextron-abc/data/" + FILE).header_offset + 30 + len("dextron-abc/data/" + FILE)
    content[start + 20 : start + 40] = bytes(20)
    file.write_bytes(content)
    assert import_error(file, small_release).startswith(FILE)


def test_members_outside_the_release_are_never_read_or_written(small_release: SmallRelease, tmp_path: Path):
    members = {f"../../../{name}": b"x" for name in ("evil.json", FILE)} | {"/evil.json": b"x", "..\\evil.json": b"x"}
    file = small_release.zip(top="")
    with zipfile.ZipFile(file, "a") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    recorded_cache.import_release(file, Manifest.load(small_release.manifest))
    assert {file.name for file in tmp_path.rglob("*") if file.is_file()} == {
        *("release.zip", "manifest.json", recorded_cache.CACHE_FILE)
    }


def test_a_release_with_dots_in_its_paths_is_refused(small_release: SmallRelease):
    assert "lacks 6 of 6" in import_error(small_release.zip(top="../../"), small_release)


def test_a_file_that_occurs_twice_is_refused(small_release: SmallRelease):
    file = small_release.zip()
    with warnings.catch_warnings(), zipfile.ZipFile(file, "a") as archive:
        warnings.simplefilter("ignore")
        archive.writestr("dextron-abc/data/" + FILE, b"other")
    assert f"{FILE}: the archive has it twice" in import_error(file, small_release)


def test_the_same_file_under_two_tops_is_refused(small_release: SmallRelease):
    file = small_release.zip()
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("other/data/" + FILE, small_release.files[FILE])
    assert f"{FILE}: the archive has it twice" in import_error(file, small_release)


def test_a_symbolic_link_is_refused(small_release: SmallRelease):
    link = zipfile.ZipInfo("dextron-abc/data/" + FILE)
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    file = zip_with(small_release, lambda archive: archive.writestr(link, "/etc/passwd"))
    assert f"{FILE}: is a symbolic link" in import_error(file, small_release)


def zip_with(small_release: SmallRelease, write: Callable[[zipfile.ZipFile], object]) -> Path:
    """Writes the release as a zip in which `write` replaces FILE, and returns its path."""
    file = small_release.folder / "release.zip"
    with zipfile.ZipFile(file, "w") as archive:
        write(archive)
        for name, content in small_release.files.items():
            if name != FILE:
                archive.writestr("dextron-abc/data/" + name, content)
    return file


def directory_entry(content: bytearray, member: str) -> int:
    """Index at which the entry of a member in the central directory begins."""
    return content.index(member.encode(), content.index(b"PK\x01\x02")) - 46


def test_an_encrypted_file_is_refused(small_release: SmallRelease):
    file = small_release.zip()
    content = bytearray(file.read_bytes())
    content[directory_entry(content, "dextron-abc/data/" + FILE) + 8] |= 1
    file.write_bytes(content)
    assert f"{FILE}: is encrypted" in import_error(file, small_release)


def test_a_zip_bomb_is_refused_by_its_declared_size(small_release: SmallRelease):
    assert f"{FILE}: unpacks to {MAX_FILE + 1} bytes" in import_error(
        small_release.zip({FILE: bytes(MAX_FILE + 1)}), small_release
    )


def test_a_zip_bomb_with_a_false_size_is_refused(small_release: SmallRelease):
    file = small_release.zip({FILE: bytes(100 * MAX_FILE)})
    content = bytearray(file.read_bytes())
    struct.pack_into("<I", content, directory_entry(content, "dextron-abc/data/" + FILE) + 24, 500)
    file.write_bytes(content)
    assert import_error(file, small_release).startswith(FILE)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_compression_method_without_a_size_limit_is_refused(small_release: SmallRelease, method: int):
    """A kilobyte of it can fill the memory before its size is known."""
    content = small_release.files[FILE]
    file = zip_with(small_release, lambda archive: archive.writestr("dextron-abc/data/" + FILE, content, method))
    assert f"{FILE}: uses a compression method" in import_error(file, small_release)


def test_a_large_file_in_a_folder_is_refused(small_release: SmallRelease):
    top = small_release.unpacked()
    (top / "data" / FILE).write_bytes(bytes(MAX_FILE + 1))
    assert f"{FILE}: has more than {MAX_FILE} bytes" in import_error(top, small_release)
