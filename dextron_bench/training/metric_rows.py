"""The metrics of a training: one row for each epoch and seed, in a file to which rows are added."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dextron_bench.methods.agents import AgentError
from dextron_bench.storage import atomic, records
from dextron_bench.storage.atomic import DamagedFile, IncompleteFolder
from dextron_bench.storage.records import Count, Record

METRICS = "metrics.jsonl"  # In the folder of a training.
KEYS = ("epoch", "seed")  # The names in a row that are no metrics.


class _Keys(Record, frozen=True):
    epoch: Count
    seed: Count


@dataclass(frozen=True, slots=True)
class MetricRow:
    """The metrics of an epoch and a seed."""

    epoch: int
    seed: int
    metrics: dict[str, float]


def numbers(metrics: Any, method: str) -> dict[str, float]:
    """The metrics of an epoch and a seed, as a method returned them, with Python floats as values.

    Arrays and tensors of one element count as numbers. Raises AgentError.
    """
    if not isinstance(metrics, Mapping):
        raise AgentError(f"method {method!r} must return its metrics as a dictionary; got {metrics!r}")
    if wrong := [name for name in metrics if not isinstance(name, str) or name in KEYS]:
        raise AgentError(f"method {method!r} has a metric {wrong[0]!r}; a name is a text other than {', '.join(KEYS)}")
    return {name: _number(value, name, method) for name, value in metrics.items()}


def _number(value: Any, name: str, method: str) -> float:
    try:
        return float(value.item() if hasattr(value, "item") else value)
    except Exception as error:  # Arrays and tensors of others have their own errors.
        shown = " ".join(repr(value).split())
        raise AgentError(f"metric {name!r} of method {method!r} must be one number; got {shown}") from error


def append(folder: Path, rows: Sequence[MetricRow]) -> None:
    """Adds rows at the end, where other processes can read them at once."""
    file = folder / METRICS
    with atomic.naming(file), file.open("a", encoding="utf-8") as content:
        for row in rows:
            content.write(json.dumps({"epoch": row.epoch, "seed": row.seed, **row.metrics}, sort_keys=True) + "\n")


def sync(folder: Path) -> None:
    """Writes all rows to the disk, so that they survive a power failure."""
    with atomic.naming(folder / METRICS):
        atomic.sync(folder / METRICS)


def parse(lines: bytes) -> Iterator[MetricRow | None]:
    """The row in each line; None for a line that holds none."""
    for row in records.rows(lines, dict[str, int | float]):
        try:
            keys = records.convert(row, _Keys)
        except records.Mismatch:
            yield None
        else:
            metrics = {name: value for name, value in (row or {}).items() if name not in KEYS}
            yield MetricRow(keys.epoch, keys.seed, metrics)


def read(folder: Path) -> list[MetricRow]:
    """All rows in order, none before the first epoch; raises DamagedFile.

    The last line may not be whole, while a process writes it or after this process was killed. It is left out.
    """
    file = folder / METRICS
    content = file.read_bytes() if file.exists() else b""
    rows = list(parse(content[: content.rfind(b"\n") + 1]))
    if None in rows:
        raise DamagedFile(folder, f"{METRICS}: line {rows.index(None) + 1} does not hold the metrics of an epoch")
    return [row for row in rows if row]


def first(folder: Path, count: int) -> bytes:
    """The first lines, as bytes; raises DamagedFile if some are missing."""
    file = folder / METRICS
    lines = file.read_bytes().splitlines(keepends=True)[:count] if file.exists() else []
    if len(lines) < count or not all(line.endswith(b"\n") for line in lines):
        raise IncompleteFolder(folder, f"{METRICS} ends before line {count}, and its checkpoint needs it")
    return b"".join(lines)


def cut(folder: Path, count: int) -> None:
    """Removes all lines after the first ones; raises DamagedFile if some of these are missing."""
    file, kept = folder / METRICS, first(folder, count)
    if file.exists() and file.read_bytes() != kept:
        atomic.write_atomically(file, lambda part: part.write_bytes(kept))
