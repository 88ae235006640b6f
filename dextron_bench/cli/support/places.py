"""What chooses another place for a file that cannot be written: a flag of the command, or a variable."""

from __future__ import annotations

import dataclasses
import errno
import os
from pathlib import Path
from typing import Any

REFUSED = {errno.EACCES, errno.EPERM, errno.EROFS}
CACHE = "DEXTRON_CACHE"


def advice(error: BaseException, command: Any) -> str:
    """The end of the line about a file that cannot be written; empty for another error, or if nothing chooses it."""
    if not isinstance(error, OSError) or error.errno not in REFUSED or not isinstance(error.filename, str):
        return ""
    file = Path(error.filename).absolute()
    if (file.exists() and not os.access(file, os.R_OK)) or os.access(_nearest_folder(file), os.W_OK):
        return ""
    if flag := next((name for name, path in _paths(command) if _are_nested(file, path)), ""):
        return f"; {flag} chooses another place"
    from dextron_bench.reaches.recorded import cache
    from dextron_bench.storage.home import NoHome

    try:
        return f"; {CACHE} names another folder" if _are_nested(file, cache.cache_folder()) else ""
    except NoHome:
        return ""


def _are_nested(file: Path, place: Path) -> bool:
    """True if one path is the other, or lies below it: the folder that cannot be made may be one around the place."""
    return file.is_relative_to(place.absolute()) or place.absolute().is_relative_to(file)


def _nearest_folder(file: Path) -> Path:
    """The innermost folder around a path that exists."""
    return next(place for place in file.parents if place.is_dir())


def _paths(command: Any) -> list[tuple[str, Path]]:
    """The flags of a command whose value is a path, the longest path first."""
    values = (
        [] if command is None else [(field.name, getattr(command, field.name)) for field in dataclasses.fields(command)]
    )
    paths = [(f"--{name.replace('_', '-')}", value) for name, value in values if isinstance(value, Path)]
    return sorted(paths, key=lambda pair: -len(pair[1].absolute().parts))
