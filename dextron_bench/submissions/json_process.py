"""A module that checks JSON of a stranger on its standard input, in a process of its own (see `bundle.parse`).

Its arguments are the kind of content and the name of the file. It prints the fault and ends with code 1 if there is
one.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from dextron_bench.submissions import bundle


def main(name: str, file: str) -> int:
    """Checks the JSON of a file; returns the exit code."""
    try:
        kind = next(kind for kind, known in bundle.KINDS.items() if known == name)
        bundle.check(json.loads(sys.stdin.buffer.read()), kind, Path(file))
    except bundle.BadBundle as error:
        print(ascii(str(error)))
        return 1
    except (ValueError, RecursionError) as error:
        print(ascii(f"{file} is not valid JSON ({error})"))
        return 1
    return 0
