"""A look at recordings of unknown origin, in a process that may die of them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from dextron_bench.recording.archive import BrokenRecording


def probe(files: Sequence[Path]) -> None:
    """Decodes recordings with Rerun's own command; raises BrokenRecording for the first that cannot be.

    Of files with a flipped bit, 2 in 100 abort the process that reads them (rerun-sdk 0.41). After this,
    or with its SHA-256 known, `read` is safe. Costs seconds, however many the files.
    """
    for file in files:
        if not file.is_file():
            raise BrokenRecording(file, "there is no such file")
    if files and not _decodes(files):
        raise BrokenRecording(_first_broken(files), "is cut short, damaged, or no .rrd file")


def _first_broken(files: Sequence[Path]) -> Path:
    """The first file that does not decode, by halving."""
    while len(files) > 1:
        half = len(files) // 2
        files = files[half:] if _decodes(files[:half]) else files[:half]
    return files[0]


def _decodes(files: Sequence[Path]) -> bool:
    command = [sys.executable, "-m", "rerun", "rrd", "verify", *(str(file.resolve()) for file in files)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0
