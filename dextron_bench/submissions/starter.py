"""Copies the template of an agent into a new folder."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from dextron_bench.errors import BadInput

FILES = ("agent.py", "test_agent.py")


def copy_template(folder: Path) -> list[Path]:
    """Writes the template's files into a new or empty folder and returns them; raises BadInput, OSError."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInput(f"{folder} exists already; name a new folder")
    folder.mkdir(parents=True, exist_ok=True)
    template = files("dextron_bench.submissions.template")
    for name in FILES:
        (folder / name).write_text(template.joinpath(name).read_text(encoding="utf-8"), encoding="utf-8")
    return [folder / name for name in FILES]
