"""Folders: listed without hidden names, and replaced in one step."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dextron_bench.storage import atomic

try:
    import fcntl
except ImportError:  # On Windows, nothing stops two processes from changing one folder.
    fcntl = None

EXCHANGE, HERE = 2, -100  # RENAME_EXCHANGE and AT_FDCWD of Linux.
OLD = ".old"  # Ending of the name of a folder that is being replaced; the name starts with a dot.


class FolderBusy(RuntimeError):
    """A folder that another process changes."""


def visible(folder: Path, pattern: str) -> list[Path]:
    """Files and folders below a folder that match a pattern, sorted; without those below it that are hidden.

    What is hidden, with a name that starts with a dot, is not complete or was given up. A pattern that begins with
    `**/` is searched at all depths. Links to folders are followed, except to a folder around the link.
    """
    name = pattern.removeprefix("**/")
    places = [folder] if name == pattern else _folders(folder, (os.path.realpath(folder),))
    paths = {path for place in places for path in place.glob(name)}
    return sorted(path for path in paths if not any(part.startswith(".") for part in path.relative_to(folder).parts))


def _folders(folder: Path, around: tuple[str, ...]) -> Iterator[Path]:
    """A folder and all visible folders below it; `around` are the real paths of this folder and of those around it."""
    yield folder
    with suppress(PermissionError, NotADirectoryError, FileNotFoundError), os.scandir(folder) as entries:
        below = [
            Path(folder, entry.name) for entry in entries if not entry.name.startswith(".") and os.path.isdir(entry)
        ]
        for place in below:
            if (real := os.path.realpath(place)) not in around:
                yield from _folders(place, (*around, real))


def links(folder: Path) -> list[Path]:
    """The symbolic links at or below a folder; what they lead to is not searched."""
    if folder.is_symlink():
        return [folder]
    places = [Path(place, name) for place, folders, files in os.walk(folder) for name in (*folders, *files)]
    return [place for place in places if place.is_symlink()]


def move(folder: Path, place: Path) -> None:
    """Moves a folder, or a link to one. Links at and below it lead where they led before."""
    here = Path(os.path.realpath(folder.parent), folder.name)
    relative = [link for link in links(folder) if not os.path.isabs(os.readlink(link))]
    targets = {link.relative_to(folder): os.path.realpath(link) for link in relative}
    shutil.move(folder, place)
    for name, target in targets.items():
        if not Path(target).is_relative_to(here):
            (place / name).unlink()
            (place / name).symlink_to(target, target_is_directory=os.path.isdir(target))


def remove(folder: Path) -> list[Path]:
    """Removes a folder with all its files, and of links, there and below, the link alone.

    Returns the folders that such links led to.
    """
    targets = [Path(os.path.realpath(link)) for link in links(folder) if link.is_dir()]
    if folder.is_symlink():
        folder.unlink()
    else:
        shutil.rmtree(folder)
    return targets


@contextmanager
def replacing(folder: Path) -> Iterator[Path]:
    """Yields a copy of a folder beside it, hidden; at the end, the copy takes its place in one step.

    If the process dies at any moment, the folder holds all of its old content or all of its new content. After an error
    it holds the old content. What a process that was killed left behind is removed by the next call. Raises FolderBusy
    if another process replaces a folder beside this one.
    """
    folder = folder.resolve()
    part = folder.with_name(f".{folder.name}{atomic.PART}")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with locked(folder.parent, folder), atomic.naming(folder):
        recover(folder)
        shutil.rmtree(part, ignore_errors=True)
        try:
            if folder.exists():
                shutil.copytree(folder, part, symlinks=True)
            else:
                part.mkdir()
            yield part
            _sync_tree(part)
            _put(part, folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)


def recover(folder: Path) -> None:
    """Restores a folder whose replacement was interrupted on a system that has no exchange of folders."""
    old = folder.with_name(f".{folder.name}{OLD}")
    if old.exists() and not folder.exists():
        old.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def _put(part: Path, folder: Path) -> None:
    """Gives `part` the name of `folder`; the old folder is removed, or has the name of `part` afterwards."""
    if not folder.exists():
        part.rename(folder)
    elif not _exchange(part, folder):
        old = folder.with_name(f".{folder.name}{OLD}")
        folder.rename(old)
        part.rename(folder)
        shutil.rmtree(old, ignore_errors=True)
    atomic.sync(folder.parent)


def _exchange(first: Path, second: Path) -> bool:
    """Exchanges the names of two folders in one step; False if this system cannot."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None) if os.name == "posix" else None
    if rename is None:
        return False
    if rename(HERE, os.fsencode(first), HERE, os.fsencode(second), EXCHANGE) == 0:
        return True
    if (number := ctypes.get_errno()) in (errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP):
        return False
    raise OSError(number, os.strerror(number), str(second))


def _sync_tree(folder: Path) -> None:
    """Writes all files and names below a folder to the disk."""
    for place, _, names in os.walk(folder):
        for file in (Path(place) / name for name in names):
            if file.is_file() and not file.is_symlink():
                atomic.sync(file)
        atomic.sync(Path(place))


@contextmanager
def locked(place: Path, changed: Path) -> Iterator[None]:
    """Holds the lock of a folder while `changed`, at or below it, is changed; raises FolderBusy."""
    if fcntl is None:
        yield
        return
    descriptor = os.open(place, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FolderBusy(f"another process is changing {changed}; wait for it, and run again") from None
        yield
    finally:
        os.close(descriptor)
