"""A folder belongs to one config: the first writer records it, later writers must have the same."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dextron_bench.storage import atomic


class FolderMismatch(ValueError):
    """A folder that belongs to another config than the given one."""


def check(file: Path, config: Mapping[str, Any], content: str, advice: str) -> None:
    """Raises FolderMismatch if `file` holds another config than this one, DamagedFile if it cannot be read.

    A file that does not exist raises nothing. The message says that the folder holds another `content`, such as
    "run", names the entries that differ, and ends with `advice`.
    """
    if not file.exists():
        return
    stored, expected = atomic.read_json(file), json.loads(json.dumps(config))
    if names := list(_differences(stored, expected)):
        raise FolderMismatch(f"{file.parent} holds another {content}: it differs in {' and '.join(names)}; {advice}")


def write_or_check(file: Path, config: Mapping[str, Any], content: str, advice: str) -> None:
    """Writes the config if `file` does not exist; raises the same errors as `check`."""
    if not file.exists():
        atomic.write_json(file, config)
    check(file, config, content, advice)


def _differences(stored: Mapping[str, Any], expected: Mapping[str, Any]) -> Iterator[str]:
    """Names of the entries of `expected` that are not stored like that; inner names of a mapping in brackets."""
    for name, value in expected.items():
        other = stored.get(name)
        if other == value:
            continue
        if isinstance(value, dict) and isinstance(other, dict):
            inner = sorted(key for key in value | other if value.get(key) != other.get(key))
            yield f"{name} ({', '.join(inner)})"
        else:
            yield name
