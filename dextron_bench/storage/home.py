"""The home folder of the user, which a user without a name, as in a container, does not have."""

from __future__ import annotations

from pathlib import Path


class NoHome(LookupError):
    """A path in a home folder that is not known; the message says what to do."""


def folder(instead: str) -> Path:
    """The home folder of the user; raises NoHome, whose message says what to do `instead`."""
    try:
        return Path.home()
    except RuntimeError:
        raise NoHome(f"this user has no home folder: {instead}") from None


def expanded(path: Path) -> Path:
    """A path with the home folder for its `~`; raises NoHome."""
    try:
        return path.expanduser()
    except RuntimeError:
        raise NoHome(f"the home folder in {path} is not known: write the whole path") from None
