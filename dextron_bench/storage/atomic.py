"""Writes files completely or not at all, and reads JSON files with a clear error."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any


class DamagedFile(ValueError):
    """A file that cannot be read; the message names it and says what to do."""

    def __init__(self, file: Path, why: object) -> None:
        super().__init__(f"{file} is damaged ({why}); remove it and run again")


def write_atomically(file: Path, write: Callable[[Path], object]) -> None:
    """Calls `write` on a temporary file, then replaces `file` with it in one step.

    If the process dies at any moment, `file` holds its old content or its new content. Errors leave no temporary file.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    temporary = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        write(temporary)
        with temporary.open("rb+") as content:
            os.fsync(content.fileno())
        os.replace(temporary, file)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(file: Path, value: Any) -> None:
    """Writes a JSON file atomically, with sorted keys."""
    text = json.dumps(value, indent=1, sort_keys=True) + "\n"
    write_atomically(file, lambda part: part.write_text(text, encoding="utf-8"))


def read_json(file: Path) -> dict[str, Any]:
    """Reads a JSON object from a file; raises DamagedFile."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise DamagedFile(file, error) from error
    if not isinstance(content, dict):
        raise DamagedFile(file, "it does not hold a JSON object")
    return content
