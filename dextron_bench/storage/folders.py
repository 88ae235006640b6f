"""Folders: listed without hidden names, and replaced in one step."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from dextron_bench.errors import Failed
from dextron_bench.storage import atomic, locks

LOCK = ".locked"  # In a folder that a process changes, or in which it replaces another folder.
EXCHANGE, HERE = 2, -100  # RENAME_EXCHANGE and AT_FDCWD of Linux.
NO_EXCHANGE = atomic.LACKING | {errno.EPERM, errno.EXDEV, errno.ENOTTY}  # Then two renames do it, or say why not.
OLD = ".old"  # Ending of the name of a folder that is being replaced; the name starts with a dot.


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
    it holds the old content. What a process that was killed left behind is removed by the next call. Raises Failed
    if another process replaces a folder beside this one.
    """
    folder = folder.resolve()
    part = _part(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with locked(folder.parent, folder), atomic.naming(folder):
        recover(folder)
        shutil.rmtree(part, ignore_errors=True)
        try:
            if folder.exists():
                copy_tree(folder, part)
            else:
                part.mkdir()
            yield part
            _sync_tree(part)
            _put(part, folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)


def recover(folder: Path) -> None:
    """Restores a folder whose replacement was interrupted on a system that has no exchange of folders."""
    old = _old(folder)
    if old.exists() and (_part(folder).exists() or not folder.exists()):  # Else the new folder has its name.
        shutil.rmtree(folder, ignore_errors=True)
        old.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def _put(part: Path, folder: Path) -> None:
    """Gives `part` the name of `folder`; the old folder is removed, or has the name of `part` afterwards."""
    if not folder.exists():
        part.rename(folder)
    elif not _exchange(part, folder):
        old = _old(folder)
        _move_away(folder, old)
        part.rename(folder)
        shutil.rmtree(old, ignore_errors=True)
    atomic.sync(folder.parent)


def _part(folder: Path) -> Path:
    """The new content of a folder; whoever writes it holds the lock."""
    return folder.with_name(f".{folder.name}{atomic.PART}")


def _old(folder: Path) -> Path:
    """The whole old content of a folder."""
    return folder.with_name(f".{folder.name}{OLD}")


def _move_away(folder: Path, old: Path) -> None:
    """Gives a folder another name, or copies and removes it: a folder of a container's image cannot be renamed."""
    try:
        folder.rename(old)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        copy = _part(old)
        shutil.rmtree(copy, ignore_errors=True)  # From a process that was killed.
        copy_tree(folder, copy)
        _sync_tree(copy)
        copy.rename(old)
        shutil.rmtree(folder)


def copy_tree(folder: Path, into: Path) -> None:
    """Copies a folder, with modes and times where the file system has them; links stay links."""
    into.mkdir()
    with os.scandir(folder) as entries:
        for entry in entries:
            target = into / entry.name
            if entry.is_symlink():
                target.symlink_to(os.readlink(entry.path))
            elif entry.is_dir():
                copy_tree(Path(entry.path), target)
            else:
                shutil.copyfile(entry.path, target)
                _copy_times(Path(entry.path), target)
    _copy_times(folder, into)


def _copy_times(source: Path, target: Path) -> None:
    with suppress(OSError):  # EPERM of FAT, ENOTSUP of some shares: content is what counts.
        shutil.copystat(source, target)


def _exchange(first: Path, second: Path) -> bool:
    """Exchanges the names of two folders in one step; False if this system cannot."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None) if os.name == "posix" else None
    if rename is None:
        return False
    if rename(HERE, os.fsencode(first), HERE, os.fsencode(second), EXCHANGE) == 0:
        return True
    if (number := ctypes.get_errno()) in NO_EXCHANGE:
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
    """Holds the lock of a folder while `changed`, at or below it, is changed; raises Failed."""
    with ExitStack() as lock:
        try:
            lock.enter_context(locks.held(place / LOCK))
        except locks.Held as error:
            raise Failed(f"another process is changing {changed}; wait for it, and run again ({error})") from None
        yield
