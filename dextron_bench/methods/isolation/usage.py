"""What a process and its children use: memory and disk, measured from outside (Linux).

Limits that the system sets for one process do not see memory that several processes share, nor files.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

BLOCK = 512  # [bytes] in which the system counts the size of a file on the disk.
OWN = ("RssAnon", "RssShmem", "VmSwap")  # Lines of /proc/PID/status: memory that no file on the disk holds.


def process_tree(process: int) -> list[int]:
    """The ids of a process and of all its descendants; processes that end meanwhile are left out."""
    tree = [process]
    for parent in tree:  # Grows while it is read.
        with suppress(OSError, ValueError):
            for thread in os.listdir(f"/proc/{parent}/task"):
                children = Path(f"/proc/{parent}/task/{thread}/children").read_text().split()
                tree += [int(child) for child in children]
    return tree


def memory(tree: list[int]) -> int:
    """The memory [bytes] of processes: their own, what they share with others, and files without a name."""
    nameless: dict[tuple[int, int], int] = {}
    total = 0
    for process in tree:
        status = _status(process)
        total += sum(status.get(name, 0) for name in OWN)
        nameless.update(_nameless_files(process))
    return total + sum(nameless.values())


def peak_memory(process: int) -> int:
    """The highest use of memory [bytes] of one process, 0 if the system does not report it."""
    return _status(process).get("VmHWM", 0)


def disk(folder: str) -> int:
    """The size [bytes] of all files below a folder, on the disk."""
    total, folders = 0, [folder]
    while folders:
        with suppress(OSError), os.scandir(folders.pop()) as entries:
            for entry in entries:
                with suppress(OSError):
                    total += BLOCK * entry.stat(follow_symlinks=False).st_blocks
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
    return total


def _status(process: int) -> dict[str, int]:
    """The sizes [bytes] in a process's status; empty if it has ended or the system has no such file."""
    with suppress(OSError):
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
        words = [line.split() for line in lines if line.endswith(" kB")]
        return {name.rstrip(":"): int(size) * 1024 for name, size, _ in words}
    return {}


def _nameless_files(process: int) -> Iterator[tuple[tuple[int, int], int]]:
    """Open files that have no name, such as `memfd_create` makes: device and number, and size [bytes]."""
    with suppress(OSError):
        for descriptor in os.listdir(f"/proc/{process}/fd"):
            with suppress(OSError):
                file = os.stat(f"/proc/{process}/fd/{descriptor}")
                if stat.S_ISREG(file.st_mode) and file.st_nlink == 0:
                    yield (file.st_dev, file.st_ino), BLOCK * file.st_blocks
