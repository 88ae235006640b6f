"""Tells what recordings say of themselves, one JSON line a file, in a process that a damaged one may end.

Run as a script, it imports nothing of this package and so starts quickly. Standard input names a file a line, in
JSON; with the word `whole` all of a file is decoded, not its properties alone.
"""

from __future__ import annotations

import json
import sys
from contextlib import suppress
from typing import Any

from rerun.chunk import RrdReader

PROPERTIES = "/__properties/"
MEMORY = 4 << 30  # [bytes] of address space. One flipped bit made Rerun ask for 23 GB (rerun-sdk 0.41).


def main() -> None:
    """Says `null` once it can read, then of each file its applications and properties, or why it has none."""
    _bound_memory()
    print("null", flush=True)
    for line in sys.stdin:
        try:
            told = _told(json.loads(line), "whole" in sys.argv[1:])
        except Exception as error:  # Rerun's readers raise whatever they meet.
            told = {"error": " ".join(str(error).split())}
        print(json.dumps(told), flush=True)


def _told(file: str, whole: bool) -> dict[str, Any]:
    reader, properties = RrdReader(file), {}
    stream = reader.store().stream()
    for chunk in stream if whole else stream.filter(content=f"{PROPERTIES}**"):
        columns = chunk.to_record_batch()
        if chunk.entity_path.startswith(PROPERTIES):
            group = properties.setdefault(chunk.entity_path.removeprefix(PROPERTIES), {})
            cells = columns.to_pydict().items()
            group |= {name: cell[0][0] for name, cell in cells if not name.startswith("rerun.")}
    return {"applications": [entry.application_id for entry in reader.recordings()], "properties": properties}


def _bound_memory() -> None:
    with suppress(ImportError, OSError, ValueError):  # Not every system can.
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


if __name__ == "__main__":
    main()
