"""The cache of recorded reaches. The benchmark imports the authors' release once, then reads the cache in milliseconds.

One file holds all cleaned reaches, a digest of its content, and the digest of the manifest that they were checked
against. The file is written under a temporary name and then renamed, so an interrupted import leaves no cache file.
"""

from __future__ import annotations

import hashlib
import os
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dextron_bench.errors import NotFound
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.recorded import parsing, release
from dextron_bench.reaches.recorded.release import Manifest
from dextron_bench.storage import home
from dextron_bench.storage.atomic import write_atomically
from dextron_bench.storage.progress import Progress, no_progress

CACHE_FILE = "real-reaches.npz"
LAYOUT = "1"  # Version of the layout of the cache file; a file of another version counts as damaged.
COLUMNS = ("names", "counts", "times", "positions", "quaternions", "reached")


class MissingData(NotFound):
    """The recorded reaches are not on this machine; the message says how to get them."""

    def __init__(self, reason: str = "have not been imported") -> None:
        super().__init__(
            f"the recorded reaches {reason}: run `dextron-bench data import --from <zip or folder>`, "
            "or `dextron-bench data fetch` to download them"
        )


def cache_folder() -> Path:
    """The folder for imported data: DEXTRON_CACHE, or the platform's default for caches; raises NoHome."""
    if named := os.environ.get("DEXTRON_CACHE"):
        return home.expanded(Path(named))
    if named := os.environ.get({"win32": "LOCALAPPDATA", "darwin": ""}.get(sys.platform, "XDG_CACHE_HOME")):
        return Path(named) / "dextron-bench"
    base = home.folder("DEXTRON_CACHE names a folder for imported data")
    if sys.platform == "darwin":
        base = base / "Library" / "Caches"
    elif sys.platform == "win32":
        base = base / "AppData" / "Local"
    else:
        base = base / ".cache"
    return base / "dextron-bench"


def cache_file() -> Path:
    """The path of the file of imported reaches, which need not exist; raises NoHome."""
    return cache_folder() / CACHE_FILE


def imported() -> Path | None:
    """The file of imported reaches, None if there is none."""
    try:
        return file if (file := cache_file()).exists() else None
    except (home.NoHome, PermissionError):
        return None


def import_release(location: Path, manifest: Manifest | None = None, progress: Progress = no_progress) -> list[Reach]:
    """Reads and checks the release at `location`, stores it in the cache, and returns its reaches.

    Raises BadInput if a file differs from the published one, OSError if the cache cannot be written, NoHome.
    """
    file, manifest = cache_file(), manifest or Manifest.load()
    reaches = release.read(location, manifest, progress)
    _write(file, reaches, manifest)
    return reaches


def load_reaches(manifest: Manifest | None = None) -> list[Reach]:
    """The recorded reaches, sorted by name, from the cache or else from the release that DEXTRON_DATA names.

    Raises MissingData if neither can be read, BadInput as `import_release` does.
    """
    manifest = manifest or Manifest.load()
    try:
        cached, problem = _read(cache_file(), manifest)
    except home.NoHome as error:
        cached, problem = None, f"have not been imported ({error})"
    if cached is not None:
        return cached
    if location := os.environ.get("DEXTRON_DATA"):
        return release.read(home.expanded(Path(location)), manifest)
    raise MissingData(problem)


def _write(file: Path, reaches: Sequence[Reach], manifest: Manifest) -> None:
    columns = _columns(reaches)
    digests = {"manifest": np.array(manifest.digest), "digest": np.array(_digest(columns, manifest))}

    def save(part: Path) -> None:
        with part.open("wb") as stream:  # Given a path, savez would append a suffix to it.
            np.savez(stream, allow_pickle=False, **columns, **digests)

    write_atomically(file, save)


def _read(file: Path, manifest: Manifest) -> tuple[list[Reach] | None, str]:
    """The reaches in a cache file, or None and the reason why there are none, as a phrase for MissingData."""
    try:
        with np.load(file, allow_pickle=False) as stored:
            if str(stored["manifest"]) != manifest.digest:
                return None, "were imported from another release"
            columns, digest = {name: stored[name] for name in COLUMNS}, str(stored["digest"])
    except FileNotFoundError:
        return None, "have not been imported"
    except (ValueError, KeyError, EOFError, OSError, zipfile.BadZipFile) as error:
        return None, f"cannot be read from {file} ({type(error).__name__})"
    if digest != _digest(columns, manifest):
        return None, f"are damaged or of an older layout in {file}"
    return _reaches(columns), ""


def _digest(columns: dict[str, np.ndarray], manifest: Manifest) -> str:
    """SHA-256 of the layout, the manifest and every value."""
    digest = hashlib.sha256(f"{LAYOUT} {manifest.digest}".encode())
    for name in COLUMNS:
        column = columns[name]
        digest.update(f"{name} {column.dtype.str} {column.shape}".encode())
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def _columns(reaches: Sequence[Reach]) -> dict[str, np.ndarray]:
    return {
        "names": np.array([reach.name for reach in reaches]),
        "counts": np.array([len(reach.times) for reach in reaches], dtype=np.int64),
        "times": np.concatenate([reach.times for reach in reaches]),
        "positions": np.concatenate([reach.positions for reach in reaches]),
        "quaternions": np.concatenate([reach.quaternions for reach in reaches]),
        "reached": np.array([reach.reached for reach in reaches]),
    }


def _reaches(columns: dict[str, np.ndarray]) -> list[Reach]:
    cuts = np.cumsum(columns["counts"])[:-1]
    parts = zip(
        columns["names"].tolist(),
        np.split(columns["times"], cuts),
        np.split(columns["positions"], cuts),
        np.split(columns["quaternions"], cuts),
        columns["reached"].tolist(),
        strict=True,
    )
    return [Reach(name, t, x, q, reached, *parsing.subject_and_region(name)) for name, t, x, q, reached in parts]
