"""A process that writes recordings for another one (see `recorder`).

It reads pickles from its standard input: a source of reaches first, then the arguments of `recording_files.write` for
one recording after the other. It answers each with a line of JSON, and ends when its input ends.
"""

from __future__ import annotations

import json
import pickle
import sys

from dextron_bench.recording.rrd_file import UnwritableRecording
from dextron_bench.runs import recording_files


def main() -> None:
    """Writes recordings until the input ends, even in the middle of a pickle."""
    try:
        source = pickle.load(sys.stdin.buffer)
        while True:
            job = pickle.load(sys.stdin.buffer)
            try:
                answer = {"sha256": recording_files.write(source, *job)}
            except UnwritableRecording as error:
                answer = {"error": error.reason}
            print(json.dumps(answer), flush=True)
    except (EOFError, pickle.UnpicklingError):
        return


if __name__ == "__main__":
    main()
