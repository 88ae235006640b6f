"""Writes files completely or not at all, and reads JSON files with a clear error."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

PART = ".part"  # Ending of the names of files and folders that are not complete; these names start with a dot.


class DamagedFile(ValueError):
    """A file whose content is not what was written; the message names it and says what to do.

    Only where this is proven does the message advise to remove anything. The subclasses are for all other cases.
    """

    def __init__(self, file: Path, why: object, advice: str = "remove it and run again") -> None:
        super().__init__(f"{file} is damaged ({why}); {advice}")


class OtherForm(DamagedFile):
    """A file that can be read, but does not hold what this version writes."""

    def __init__(self, file: Path, why: object) -> None:
        advice = "restore it, or use the version that wrote it"
        ValueError.__init__(self, f"{file} is damaged or of another version ({why}); {advice}")


class IncompleteFolder(DamagedFile):
    """A folder without a file that belongs to it, such as a copy that has not ended."""

    def __init__(self, folder: Path, why: object) -> None:
        advice = "if it is a copy, copy it again; else choose another folder"
        ValueError.__init__(self, f"{folder} is not complete ({why}); {advice}")


def write_atomically(file: Path, write: Callable[[Path], object]) -> None:
    """Calls `write` on a temporary file, then replaces `file` with it in one step.

    If the process dies at any moment, `file` holds its old content or its new content. Errors leave no temporary file;
    the temporary file of a process that was killed is removed at the next write of the same file. Raises OSError that
    names the file.
    """
    with naming(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(file)
        temporary = file.with_name(f".{file.name}.{os.getpid()}{PART}")
        try:
            write(temporary)
            with temporary.open("rb+") as content:
                os.fsync(content.fileno())
            os.replace(temporary, file)
            sync(file.parent)
        finally:
            temporary.unlink(missing_ok=True)


def sync(path: Path) -> None:
    """Writes a file, or the names in a folder, to the disk, so that they survive a power failure."""
    if os.name != "posix":  # Elsewhere a folder cannot be opened.
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """Adds the file to an OSError that names none, as a full disk raises it."""
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = str(file)
        raise


def write_json(file: Path, value: Any) -> None:
    """Writes a JSON file atomically, with sorted keys."""
    text = json.dumps(value, indent=1, sort_keys=True) + "\n"
    write_atomically(file, lambda part: part.write_text(text, encoding="utf-8"))


def read_json(file: Path) -> dict[str, Any]:
    """Reads a JSON object from a file; raises DamagedFile. `schemas.read` also checks its content."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise DamagedFile(file, error) from error
    if not isinstance(content, dict):
        raise DamagedFile(file, "it does not hold a JSON object")
    return content


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no JSON number")


def _remove_abandoned(file: Path) -> None:
    """Removes temporary files of this file whose processes have ended."""
    start = f".{file.name}."
    with os.scandir(file.parent) as entries:
        names = [entry.name for entry in entries if entry.name.startswith(start) and entry.name.endswith(PART)]
    for name in names:
        process = name.removeprefix(start).removesuffix(PART)
        if process.isdecimal() and not _is_alive(int(process)):
            file.with_name(name).unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    """False if no process has this number; True if that is not known."""
    if os.name != "posix":  # On Windows, signal 0 would end the process.
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
