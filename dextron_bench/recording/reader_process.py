"""A script that prints the properties of recordings, one line of JSON for each file.

It runs in a process of its own with limits, because a damaged file can abort the process that decodes it. It imports
nothing of this package, so that it starts quickly. Each line of standard input is a file name in JSON. With the
argument `whole` it decodes all of a file and not only the properties.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from rerun.chunk import RrdReader

PROPERTIES = "/__properties/"
LONGEST = 2**16  # Characters of a line; whoever reads all lines of many files keeps them in memory.
TOO_LONG = f"its properties have more than {LONGEST} characters"


def main() -> None:
    """Prints `null` when it is ready, and then applications and properties of each file, or the error."""
    print("null", flush=True)
    for name in sys.stdin:
        try:
            description = _describe(json.loads(name), "whole" in sys.argv[1:])
        except Exception as error:  # Rerun's readers raise errors of any type.
            description = {"error": " ".join(str(error).split())[:LONGEST]}
        line = json.dumps(description)
        print(line if len(line) <= LONGEST else json.dumps({"error": TOO_LONG}), flush=True)


def _describe(file: str, whole: bool) -> dict[str, Any]:
    reader, properties = RrdReader(file), {}
    stream = reader.store().stream()
    for chunk in stream if whole else stream.filter(content=f"{PROPERTIES}**"):
        columns = chunk.to_record_batch()
        if chunk.entity_path.startswith(PROPERTIES):
            group = properties.setdefault(chunk.entity_path.removeprefix(PROPERTIES), {})
            cells = columns.to_pydict().items()
            group |= {name: cell[0][0] for name, cell in cells if not name.startswith("rerun.")}
    return {"applications": [entry.application_id for entry in reader.recordings()], "properties": properties}


if __name__ == "__main__":
    main()
