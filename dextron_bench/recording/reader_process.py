"""A script that prints the properties of recordings, one line of JSON for each file.

It runs in a process of its own with limits, because a damaged file can abort the process that decodes it. It imports
nothing of this package, so that it starts quickly. Each line of standard input is JSON: the name of a file, and whether
it has a footer. With the argument `whole` it decodes all of a file and not only the properties.
"""

from __future__ import annotations

import json
import sys

from rerun.chunk import RrdReader

PROPERTIES = "/__properties/"
LONGEST = 2**16  # Characters of a line; whoever reads all lines of many files keeps them in memory.
Properties = dict[str, str | int | float | bool | None]
TOO_LONG = f"its properties have more than {LONGEST} characters"


def main(extent: str = "") -> None:
    """Prints applications and properties of each file, or the `error` of the decoder, or the limit that it exceeds."""
    for line in sys.stdin:
        file, has_footer = json.loads(line)
        try:
            description = _describe(file, has_footer, extent == "whole")
        except MemoryError:
            description = {"limit": "it needs too much memory"}
        except Exception as error:  # Rerun's readers raise errors of any type.
            description = {"error": " ".join(str(error).split())[:LONGEST]}
        answer = json.dumps(description)
        print(answer if len(answer) <= LONGEST else json.dumps({"limit": TOO_LONG}), flush=True)


def _describe(file: str, has_footer: bool, whole: bool) -> dict[str, list[str] | dict[str, Properties]]:
    reader, properties = RrdReader(file), dict[str, Properties]()
    stream = (reader.store() if has_footer else reader).stream()
    for chunk in stream if whole else stream.filter(content=f"{PROPERTIES}**"):
        columns = chunk.to_record_batch()
        if chunk.entity_path.startswith(PROPERTIES):
            group = properties.setdefault(chunk.entity_path.removeprefix(PROPERTIES), {})
            cells = columns.to_pydict().items()
            group |= {name: cell[0][0] for name, cell in cells if not name.startswith("rerun.")}
    return {"applications": [entry.application_id for entry in reader.recordings()], "properties": properties}
