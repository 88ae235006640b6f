"""Releases that are damaged or hostile, and the folders and zips that are neither."""

from __future__ import annotations

import stat
import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from dextron_bench.reaches.recorded import cache as recorded_cache
from dextron_bench.reaches.recorded.release import MAX_FILE, Manifest, ReleaseError
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


@pytest.mark.parametrize("where", ["", "data", "data/extracts", ".."])
def test_a_folder_may_be_named_at_any_level(small_release: SmallRelease, where: str):
    reaches = read_release(small_release.unpacked() / where, Manifest.load(small_release.manifest))
    assert [reach.name for reach in reaches] == list(NAMES)


@pytest.mark.parametrize("top", ["dextron-abc/data/", "data/", ""])
def test_a_zip_may_have_any_top(small_release: SmallRelease, top: str):
    manifest = Manifest.load(small_release.manifest)
    assert [reach.name for reach in read_release(small_release.zip(top=top), manifest)] == list(NAMES)


def refused(where: Path, small_release: SmallRelease) -> str:
    with pytest.raises(ReleaseError) as caught:
        recorded_cache.import_release(where, Manifest.load(small_release.manifest))
    assert not recorded_cache.cache_file().exists()
    return str(caught.value)


def test_a_changed_value_is_named_by_its_hash(small_release: SmallRelease):
    where = small_release.zip({FILE: small_release.files[FILE].replace(b"-0.5", b"-0.6")})
    assert refused(where, small_release).startswith(f"{FILE}: its SHA-256 is not the published one")


def test_a_cut_file_is_named_by_line(small_release: SmallRelease):
    assert refused(small_release.zip({FILE: small_release.files[FILE][:-9]}), small_release).startswith(
        f"{FILE}: line 6: "
    )


def test_a_missing_file_is_named(small_release: SmallRelease):
    top = small_release.unpacked()
    (top / "data" / FILE).unlink()
    assert f"lacks 1 of 6 files, first {FILE}" in refused(top, small_release)


def test_a_file_that_is_no_zip_or_a_cut_one_is_refused(small_release: SmallRelease):
    whole = small_release.zip()
    whole.write_bytes(whole.read_bytes()[:-40])
    assert "is not a valid zip file" in refused(whole, small_release)


def test_bytes_damaged_inside_the_zip_are_named(small_release: SmallRelease):
    where = small_release.zip()
    content = bytearray(where.read_bytes())
    with zipfile.ZipFile(where) as made:
        start = made.getinfo("dextron-abc/data/" + FILE).header_offset + 30 + len("dextron-abc/data/" + FILE)
    content[start + 20 : start + 40] = bytes(20)
    where.write_bytes(content)
    assert refused(where, small_release).startswith(FILE)


def test_members_outside_the_release_are_never_read_or_written(small_release: SmallRelease, tmp_path: Path):
    evil = {f"../../../{name}": b"x" for name in ("evil.json", FILE)} | {"/evil.json": b"x", "..\\evil.json": b"x"}
    where = small_release.zip(top="")
    with zipfile.ZipFile(where, "a") as made:
        for name, content in evil.items():
            made.writestr(name, content)
    recorded_cache.import_release(where, Manifest.load(small_release.manifest))
    assert {file.name for file in tmp_path.rglob("*") if file.is_file()} == {
        *("release.zip", "manifest.json", recorded_cache.CACHE_FILE)
    }


def test_a_release_that_is_only_reached_through_dots_is_refused(small_release: SmallRelease):
    assert "lacks 6 of 6" in refused(small_release.zip(top="../../"), small_release)


def test_a_file_that_is_there_twice_is_refused(small_release: SmallRelease):
    where = small_release.zip()
    with warnings.catch_warnings(), zipfile.ZipFile(where, "a") as made:
        warnings.simplefilter("ignore")
        made.writestr("dextron-abc/data/" + FILE, b"other")
    assert f"{FILE}: the archive has it twice" in refused(where, small_release)


def test_the_same_file_under_two_tops_is_refused(small_release: SmallRelease):
    where = small_release.zip()
    with zipfile.ZipFile(where, "a") as made:
        made.writestr("other/data/" + FILE, small_release.files[FILE])
    assert f"{FILE}: the archive has it twice" in refused(where, small_release)


def test_a_link_is_refused(small_release: SmallRelease):
    link = zipfile.ZipInfo("dextron-abc/data/" + FILE)
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    where = rewritten(small_release, lambda made: made.writestr(link, "/etc/passwd"))
    assert f"{FILE}: is a symbolic link" in refused(where, small_release)


def rewritten(small_release: SmallRelease, write: Callable[[zipfile.ZipFile], object]) -> Path:
    """The release's zip with FILE left out and what `write` adds instead."""
    where = small_release.folder / "release.zip"
    with zipfile.ZipFile(where, "w") as made:
        write(made)
        for file, content in small_release.files.items():
            if file != FILE:
                made.writestr("dextron-abc/data/" + file, content)
    return where


def central(content: bytearray, member: str) -> int:
    """Where the central directory's entry of a member begins."""
    return content.index(member.encode(), content.index(b"PK\x01\x02")) - 46


def test_an_encrypted_file_is_refused(small_release: SmallRelease):
    where = small_release.zip()
    content = bytearray(where.read_bytes())
    content[central(content, "dextron-abc/data/" + FILE) + 8] |= 1
    where.write_bytes(content)
    assert f"{FILE}: is encrypted" in refused(where, small_release)


def test_a_bomb_is_refused_by_what_it_declares(small_release: SmallRelease):
    assert f"{FILE}: unpacks to {MAX_FILE + 1} bytes" in refused(
        small_release.zip({FILE: bytes(MAX_FILE + 1)}), small_release
    )


def test_a_bomb_that_lies_about_its_size_is_refused(small_release: SmallRelease):
    where = small_release.zip({FILE: bytes(100 * MAX_FILE)})
    content = bytearray(where.read_bytes())
    struct.pack_into("<I", content, central(content, "dextron-abc/data/" + FILE) + 24, 500)
    where.write_bytes(content)
    assert refused(where, small_release).startswith(FILE)


def test_a_large_file_in_a_folder_is_refused(small_release: SmallRelease):
    top = small_release.unpacked()
    (top / "data" / FILE).write_bytes(bytes(MAX_FILE + 1))
    assert f"{FILE}: has more than {MAX_FILE} bytes" in refused(top, small_release)
