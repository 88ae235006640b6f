"""A folder with an agent to begin with."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

FILES = ("agent.py", "test_agent.py")


class FolderInUse(FileExistsError):
    """A folder that holds files already."""


def begin(folder: Path) -> list[Path]:
    """Writes the starter's files into a new or empty folder; returns them. Raises FolderInUse, OSError."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise FolderInUse(f"{folder} is there already; name a new folder")
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for name in FILES:
        text = files("dextron_bench.leaderboard.submission.template").joinpath(name).read_text(encoding="utf-8")
        (folder / name).write_text(text, encoding="utf-8")
        made.append(folder / name)
    return made
