"""The cache of recorded reaches: imported once from the authors' release, then read in milliseconds.

One file holds all reaches, cleaned, with a digest of itself and of the manifest that they were checked
against. It is written beside its place and moved there whole, so that a partial import never counts.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.recorded import parsing, release
from dextron_bench.reaches.recorded.release import Manifest

CACHE_FILE = "real-reaches.npz"
LAYOUT = "1"  # Of the cache file; a cache of another layout is read from the release again.
COLUMNS = ("names", "counts", "times", "positions", "quaternions", "reached")

Progress = Callable[[int, int], None]


class MissingData(LookupError):
    """The recorded reaches are nowhere; the message says how to get them."""

    def __init__(self, reason: str = "have not been imported") -> None:
        super().__init__(
            f"the recorded reaches {reason}: run `dextron-bench data import --from <zip or folder>`, "
            "or `dextron-bench data fetch` to download them"
        )


def cache_folder() -> Path:
    """Where this machine keeps imported data: DEXTRON_CACHE, or the platform's place for caches."""
    if named := os.environ.get("DEXTRON_CACHE"):
        return Path(named).expanduser()
    if sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "dextron-bench"


def cache_file() -> Path:
    """The file of imported reaches, there or not."""
    return cache_folder() / CACHE_FILE


def import_release(where: Path, manifest: Manifest | None = None, progress: Progress | None = None) -> list[Reach]:
    """Reads and checks the release at `where`, stores it in the cache, and returns its reaches.

    Raises ReleaseError where a file is not as published, OSError where the cache cannot be written.
    """
    manifest = manifest or Manifest.load()
    reaches = release.read(where, manifest, progress)
    _write(cache_file(), reaches, manifest)
    return reaches


def load_reaches(manifest: Manifest | None = None) -> list[Reach]:
    """The recorded reaches, sorted by name: from the cache, else from the release that DEXTRON_DATA names.

    Raises MissingData where neither is there or the cache is damaged, ReleaseError as `import_release`.
    """
    manifest = manifest or Manifest.load()
    cached, problem = _read(cache_file(), manifest)
    if cached is not None:
        return cached
    if named := os.environ.get("DEXTRON_DATA"):
        return release.read(Path(named).expanduser(), manifest)
    raise MissingData(problem)


def _write(file: Path, reaches: Sequence[Reach], manifest: Manifest) -> None:
    columns = _columns(reaches)
    marks = {"manifest": np.array(manifest.digest), "digest": np.array(_digest(columns, manifest))}
    file.parent.mkdir(parents=True, exist_ok=True)
    descriptor, temporary = tempfile.mkstemp(prefix=f".{file.stem}-", suffix=".npz", dir=file.parent)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            np.savez(stream, allow_pickle=False, **columns, **marks)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, file)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _read(file: Path, manifest: Manifest) -> tuple[list[Reach] | None, str]:
    """The reaches in a cache file, or None and what is wrong with it."""
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
    return [Reach(name, t, x, q, reached, *parsing.origin(name)) for name, t, x, q, reached in parts]
