"""Files that tasks need on their nodes beside the installation."""

from __future__ import annotations

from pathlib import Path

from dextron_bench.cluster.tasks import CACHE
from dextron_bench.reaches.recorded import cache
from dextron_bench.storage.folders import visible


def imported_reaches(reaches: str) -> dict[str, Path]:
    """The file of imported reaches, as an input, if the source is `real` and they are imported on this machine."""
    file = cache.cache_file()
    return {f"{CACHE}/{file.name}": file} if reaches == "real" and file.exists() else {}


def only_file(folder: Path) -> Path | None:
    """The file in a folder of inputs; None if there is none."""
    return next(iter(visible(folder, "*")), None)
