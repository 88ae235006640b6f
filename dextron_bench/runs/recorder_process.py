"""A process that writes recordings for another one (see `recorder`).

It reads pickles from its standard input: a source of reaches first, then the arguments of `recording_files.write` for
one recording after the other. It answers each with a line of JSON, and ends when its input ends.
"""

from __future__ import annotations

import json
import os
import pickle
import sys

from dextron_bench.recording.rrd_file import UnwritableRecording
from dextron_bench.runs import recording_files


def main() -> None:
    """Writes recordings until the input ends or nobody reads the answers."""
    try:
        source = pickle.load(sys.stdin.buffer)
        while True:
            job = pickle.load(sys.stdin.buffer)
            try:
                answer = {"sha256": recording_files.write(source, *job)}
            except UnwritableRecording as error:
                answer = {"error": error.reason}
            os.write(sys.stdout.fileno(), f"{json.dumps(answer)}\n".encode())
    except (EOFError, pickle.UnpicklingError, BrokenPipeError):  # The other process has ended, perhaps by a signal.
        return


if __name__ == "__main__":
    main()
