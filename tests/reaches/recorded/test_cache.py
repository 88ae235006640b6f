"""The cache has all reaches or none, and returns them bit for bit."""

from __future__ import annotations

import errno
import os
import pwd
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.reaches import sources
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.recorded import cache as recorded_cache
from dextron_bench.reaches.recorded.release import Manifest
from dextron_bench.storage.home import NoHome
from tests.helpers.small_release import NAMES, SmallRelease


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache for each test, and no release in the environment."""
    monkeypatch.setenv("DEXTRON_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("DEXTRON_DATA", raising=False)
    return tmp_path / "cache"


def bit_equal(a: list[Reach], b: list[Reach]) -> bool:
    """True if two lists of reaches agree in every bit."""

    def parts(reach: Reach):
        arrays = (reach.times, reach.positions, reach.quaternions)
        return (reach.name, reach.reached, reach.subject, reach.ring, reach.angle, *(x.tobytes() for x in arrays))

    return [parts(reach) for reach in a] == [parts(reach) for reach in b]


def test_imported_reaches_are_read_back_bit_for_bit(small_release: SmallRelease):
    manifest = Manifest.load(small_release.manifest)
    imported = recorded_cache.import_release(small_release.zip(), manifest)
    assert bit_equal(imported, recorded_cache.load_reaches(manifest))


def test_the_error_without_reaches_says_how_to_get_them(small_release: SmallRelease):
    with pytest.raises(recorded_cache.MissingData, match=r"data import --from .*data fetch"):
        recorded_cache.load_reaches(Manifest.load(small_release.manifest))


def test_the_release_in_the_environment_is_read_if_there_is_no_cache(
    small_release: SmallRelease, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("DEXTRON_DATA", str(small_release.unpacked()))
    assert [reach.name for reach in recorded_cache.load_reaches(Manifest.load(small_release.manifest))] == list(NAMES)


def test_a_cache_of_another_release_is_refused(small_release: SmallRelease):
    recorded_cache.import_release(small_release.zip(), Manifest.load(small_release.manifest))
    with pytest.raises(recorded_cache.MissingData, match="from another release"):
        recorded_cache.load_reaches(Manifest.load())


def test_a_changed_cache_is_refused(small_release: SmallRelease):
    manifest = Manifest.load(small_release.manifest)
    recorded_cache.import_release(small_release.zip(), manifest)
    with np.load(recorded_cache.cache_file()) as stored:
        columns = dict(stored)
    columns["positions"][0, 0] += 1e-9
    with recorded_cache.cache_file().open("wb") as file:
        np.savez(file, allow_pickle=False, **columns)
    with pytest.raises(recorded_cache.MissingData, match="damaged"):
        recorded_cache.load_reaches(manifest)


@pytest.mark.parametrize("size", [0, 10, 400, 2000])
def test_a_truncated_cache_is_refused(small_release: SmallRelease, size: int):
    manifest = Manifest.load(small_release.manifest)
    recorded_cache.import_release(small_release.zip(), manifest)
    recorded_cache.cache_file().write_bytes(recorded_cache.cache_file().read_bytes()[:size])
    with pytest.raises(recorded_cache.MissingData, match="cannot be read"):
        recorded_cache.load_reaches(manifest)


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_failed_write_does_not_change_the_cache(
    small_release: SmallRelease, monkeypatch: pytest.MonkeyPatch, call: str
):
    manifest = Manifest.load(small_release.manifest)
    recorded_cache.import_release(small_release.zip(), manifest)
    before = recorded_cache.cache_file().read_bytes()

    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, call, fail)
    with pytest.raises(OSError, match="No space left"):
        recorded_cache.import_release(small_release.zip(), manifest)
    assert recorded_cache.cache_file().read_bytes() == before
    assert os.listdir(recorded_cache.cache_folder()) == [recorded_cache.CACHE_FILE]


@pytest.mark.slow
def test_the_authors_release_is_imported_completely(release: Path):
    imported = recorded_cache.import_release(release)
    assert len(imported) == 575
    source = sources.open_source("real")
    assert source.names == tuple(sorted(source.names))
    assert source.stratum("09_nr_16").subject == "09"
    assert bit_equal(imported, recorded_cache.load_reaches())
    assert 0.84 < min(reach.duration for reach in imported) < max(reach.duration for reach in imported) < 2.19
    assert all(np.all(np.diff(reach.times) > 0) and 0 < reach.reached < reach.duration for reach in imported)


@pytest.fixture
def no_home(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user without a name and a home, and no variable that names a folder."""

    def unknown(number: int) -> None:
        raise KeyError("getpwuid(): uid not found: 12345")

    for name in ("HOME", "XDG_CACHE_HOME", "DEXTRON_CACHE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)


@pytest.mark.usefixtures("no_home")
def test_a_user_without_a_home_reads_the_release_of_the_environment(
    small_release: SmallRelease, monkeypatch: pytest.MonkeyPatch
):
    manifest = Manifest.load(small_release.manifest)
    with pytest.raises(recorded_cache.MissingData, match=r"no home folder: DEXTRON_CACHE names .*data fetch"):
        recorded_cache.load_reaches(manifest)
    assert recorded_cache.imported() is None
    monkeypatch.setenv("DEXTRON_DATA", str(small_release.unpacked()))
    assert [reach.name for reach in recorded_cache.load_reaches(manifest)] == list(NAMES)


@pytest.mark.usefixtures("no_home")
def test_a_user_without_a_home_imports_into_a_folder_of_choice(
    small_release: SmallRelease, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    manifest = Manifest.load(small_release.manifest)
    with pytest.raises(NoHome, match="DEXTRON_CACHE names a folder for imported data"):
        recorded_cache.import_release(small_release.zip(), manifest)
    monkeypatch.setenv("DEXTRON_CACHE", str(tmp_path / "cache"))
    recorded_cache.import_release(small_release.zip(), manifest)
    assert recorded_cache.imported() == tmp_path / "cache" / recorded_cache.CACHE_FILE
