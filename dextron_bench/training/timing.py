"""How long epochs and evaluations of a training took, and how long the next ones take."""

from __future__ import annotations

import json
import math
from pathlib import Path
from statistics import median
from typing import Any

TIMING = "timing.jsonl"


RECENT = 50  # Epochs whose time tells that of the next.


def seconds_left(folder: Path, epochs: int, period: int) -> float | None:
    """About how long so many more epochs take [s], from those before; None where there are none."""
    rows = _timings(folder / TIMING)
    trained = [row["seconds"] for row in rows if row["what"] == "epoch"][-RECENT:]
    scored = [row["seconds"] for row in rows if row["what"] == "evaluation"][-RECENT:]
    if not trained:
        return None
    return epochs * median(trained) + math.ceil(epochs / period) * (median(scored) if scored else 0.0)


def seconds(folder: Path) -> float | None:
    """How long a training took so far, epochs and evaluations of its learning curve; None where it is not known."""
    rows = _timings(folder / TIMING)
    return round(sum(row["seconds"] for row in rows), 1) if rows else None


def _timings(file: Path) -> list[dict[str, Any]]:
    """The rows of a file of timings; lines that were cut off are left out."""
    rows = []
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else []:
        try:
            rows.append(json.loads(line))
        except ValueError:
            continue
    return rows
