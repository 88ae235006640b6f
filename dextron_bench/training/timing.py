"""Durations of epochs and evaluations of a training with the memory in use, and estimates made of them."""

from __future__ import annotations

import json
import math
import os
from contextlib import suppress
from pathlib import Path
from statistics import median

from dextron_bench.storage import atomic, records
from dextron_bench.storage.records import Amount, Count, Record

FILE = "timing.jsonl"  # In the folder of a training.
RECENT = 50  # Newest rows that an estimate uses.


class Duration(Record, frozen=True):
    """A row: the duration of an epoch or of an evaluation [s], and the memory in use [MB]."""

    what: str
    seconds: Amount
    epoch: Count | None = None
    memory: Amount | None = None
    device_memory: Amount | None = None


def append(folder: Path, activity: str, epoch: int, seconds: float, device: str) -> None:
    """Adds a row, with the memory in use: `activity` is "epoch" or "evaluation"."""
    row = {"what": activity, "epoch": epoch, "seconds": round(seconds, 4), "device": device, **memory(device)}
    with atomic.naming(folder / FILE), (folder / FILE).open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")


def memory(device: str) -> dict[str, float]:
    """Memory of this process [MB]: `memory` of the machine, if it is known, and `device_memory` of a GPU."""
    amounts = {}
    with suppress(OSError, ValueError, IndexError):  # Only Linux has this file.
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        amounts["memory"] = round(pages * os.sysconf("SC_PAGE_SIZE") / 1e6, 1)
    if device != "cpu":
        import torch

        amounts["device_memory"] = round(torch.cuda.memory_allocated(device) / 1e6, 1)
    return amounts


def seconds_left(folder: Path, epochs: int, period: int) -> float | None:
    """Estimated duration of further epochs [s], from the newest rows; None if no epoch was timed."""
    rows = _rows(folder)
    trained = [row.seconds for row in rows if row.what == "epoch"][-RECENT:]
    scored = [row.seconds for row in rows if row.what == "evaluation"][-RECENT:]
    if not trained:
        return None
    return epochs * median(trained) + math.ceil(epochs / period) * (median(scored) if scored else 0.0)


def seconds(folder: Path) -> float | None:
    """Duration of a training so far [s], epochs and evaluations of its learning curve; None if nothing was timed."""
    rows = _rows(folder)
    return round(sum(row.seconds for row in rows), 1) if rows else None


def _rows(folder: Path) -> list[Duration]:
    """All whole rows; a line that was cut off or damaged is left out, since nothing but estimates depends on it."""
    file = folder / FILE
    content = file.read_bytes() if file.exists() else b""
    return [row for row in records.rows(content, Duration) if row]
