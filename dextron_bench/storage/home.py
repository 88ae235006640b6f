"""The home folder of the user, which a user without a name, as in a container, does not have."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from dextron_bench.errors import NotFound


class NoHome(NotFound):
    """A path in a home folder that is not known; the message says what to do."""


def folder(instead: str) -> Path:
    """The home folder of the user; raises NoHome, whose message says what to do `instead`."""
    try:
        return Path.home()
    except RuntimeError:
        raise NoHome(f"this user has no home folder: {instead}") from None


@contextmanager
def lent() -> Iterator[None]:
    """For a library that asks for a home folder: an empty one that ends with the block, if the user has none."""
    try:
        Path.home()
    except RuntimeError:
        with TemporaryDirectory(prefix="dextron-home-") as empty:
            os.environ["HOME"] = empty
            try:
                yield
            finally:
                del os.environ["HOME"]
    else:
        yield


def expanded(path: Path) -> Path:
    """A path with the home folder for its `~`; raises NoHome."""
    try:
        return path.expanduser()
    except RuntimeError:
        raise NoHome(f"the home folder in {path} is not known: write the whole path") from None
