"""Writes files completely or not at all, and reads JSON files with a clear error."""

from __future__ import annotations

import errno
import json
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

import msgspec

from dextron_bench.errors import BadInput

PART = ".part"  # Ending of the names of files and folders that are not complete; these names start with a dot.
ABANDONED = 24 * 3600.0  # [s] since the last change of a temporary file whose process has surely ended.
LACKING = {  # What a file system answers to a call that it does not have; a full disk or a fault answers otherwise.
    errno.EINVAL,
    errno.ENOSYS,
    errno.EOPNOTSUPP,
    errno.ENOTSUP,
    errno.EBADF,
    errno.EROFS,
}
NO_LINKS = LACKING | {errno.EPERM, errno.EACCES, errno.EMLINK, errno.EXDEV}  # Of `os.link`, where files can be made.


class DamagedFile(BadInput):
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
    what a killed process left is removed by the first write of the same file a day later. Raises OSError that names the
    file.
    """
    _write(file, write, os.replace)


def create_json(file: Path, value: Any) -> None:
    """Writes a new JSON file, as `write_json` does; raises FileExistsError if another process was faster."""
    _write(file, _json(value), _put_new_if_possible)


def _write(file: Path, write: Callable[[Path], object], put: Callable[[Path, Path], object]) -> None:
    """Writes a temporary file to the disk; `put` gives it its name."""
    with naming(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        part = temporary(file)
        try:
            remove_abandoned(file, part)
            write(part)
            with part.open("rb+") as content:
                _fsync(content.fileno())
            put(part, file)
            sync(file.parent)
        finally:
            part.unlink(missing_ok=True)


def temporary(path: Path) -> Path:
    """A hidden name beside a file or folder, which no other process of any machine uses."""
    return path.with_name(f".{path.name}.{secrets.token_hex(8)}{PART}")


def put_new(part: Path, file: Path) -> None:
    """Gives a complete temporary file its name; raises FileExistsError if there is a file of this name.

    Where the file system has no links, an empty file takes the name first, for a moment.
    """
    try:
        os.link(part, file)
        return
    except OSError as error:
        if part.stat().st_nlink > 1:  # A network file system may do it, lose its answer, and refuse the repetition.
            return
        if isinstance(error, FileExistsError) or error.errno not in NO_LINKS:
            raise
    os.close(os.open(file, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    os.replace(part, file)


def _put_new_if_possible(part: Path, file: Path) -> None:
    """As `put_new`; the last process wins where the file system lets no process make a file alone."""
    try:
        put_new(part, file)
    except OSError as error:
        if error.errno not in LACKING:
            raise
        os.replace(part, file)


def sync(path: Path) -> None:
    """Writes a file, or the names in a folder, to the disk, so that they survive a power failure.

    Does nothing where the system or the file system has no such call.
    """
    if os.name != "posix":  # Elsewhere a folder cannot be opened.
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        _fsync(descriptor)
    finally:
        os.close(descriptor)


def _fsync(descriptor: int) -> None:
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in LACKING:
            raise


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """Adds the file to an OSError that names none, as a full disk raises it, or that names its temporary file."""
    try:
        yield
    except OSError as error:
        if error.filename is None or str(error.filename).endswith(PART):
            error.filename = str(file)
        raise


def write_json(file: Path, value: Any) -> None:
    """Writes a JSON file atomically, with sorted keys; the value may hold records."""
    write_atomically(file, _json(value))


def _json(value: Any) -> Callable[[Path], object]:
    """What writes a value as JSON."""
    text = json_text(value, indent=1) + "\n"
    return lambda part: part.write_text(text, encoding="utf-8")


def json_text(value: Any, indent: int | None = None) -> str:
    """A value, with the records in it, as JSON with sorted keys."""
    return json.dumps(value, indent=indent, sort_keys=True, default=msgspec.to_builtins)


def read_json(file: Path) -> dict[str, Any]:
    """Reads a JSON object from a file; raises DamagedFile. `records.read` also checks its content."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise DamagedFile(file, error) from error
    if not isinstance(content, dict):
        raise DamagedFile(file, "it does not hold a JSON object")
    return content


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no JSON number")


def remove_abandoned(file: Path, part: Path) -> None:
    """Removes temporary files of this file that nobody has changed for a day, by the clock of the file system.

    The clock of another machine may differ, and the number of a process means nothing in another container. A process
    that writes changes its file all the time, so the file of a living one stays. `part` is made to read the clock.
    """
    start = f".{file.name}."
    with os.scandir(file.parent) as entries:
        names = [entry.name for entry in entries if entry.name.startswith(start) and entry.name.endswith(PART)]
    if not names:
        return
    part.touch()
    now = part.stat().st_mtime
    for other in map(file.with_name, names):
        with suppress(OSError):  # Another process removes it, or may alone remove it.
            if now - other.stat().st_mtime > ABANDONED:
                other.unlink()
