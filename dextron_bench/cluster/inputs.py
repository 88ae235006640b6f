"""Files that tasks need on their nodes beside the installation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from dextron_bench.cluster.tasks import CACHE, RUNS
from dextron_bench.reaches.recorded import cache
from dextron_bench.storage import hashing

KEPT = 64  # Contents that stay in the object store for later tasks.


class References:
    """What the driver sends of input files: their SHA-256, and references to their contents in the object store.

    Many tasks share inputs, so a file is hashed again only if it has changed, and a content is stored once.
    """

    def __init__(self, put: Callable[[bytes], Any]) -> None:
        """`put` stores a content and returns a reference to it."""
        self._put = put
        self._hashes: dict[tuple[Path, int, int], str] = {}  # By path, time of change and size.
        self._stored: dict[str, Any] = {}  # By SHA-256; the last used is the last.

    def sha256(self, file: Path) -> str:
        """SHA-256 of a file."""
        about = file.stat()
        key = file, about.st_mtime_ns, about.st_size
        if key not in self._hashes:
            self._hashes[key] = hashing.sha256(file)
        return self._hashes[key]

    def reference(self, file: Path) -> Any:
        """A reference to a file's content, which is brought to each node once."""
        sha256 = self.sha256(file)
        reference = self._stored.pop(sha256, None) or self._put(file.read_bytes())
        self._stored[sha256] = reference
        if len(self._stored) > KEPT:
            del self._stored[next(iter(self._stored))]  # What tasks under way need stays in the object store.
        return reference


def of(reaches: str, files: Mapping[str, Path]) -> dict[str, Path]:
    """The inputs of a task by their place: `files` by their path below the folder of runs, and imported reaches.

    The latter are only needed if the source is `real`, and they are only sent if this machine has imported them.
    """
    imported = cache.imported() if reaches == "real" else None
    placed = {f"{RUNS}/{path}": file for path, file in files.items()}
    return placed | ({f"{CACHE}/{imported.name}": imported} if imported else {})
