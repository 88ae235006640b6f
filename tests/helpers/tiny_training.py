"""The tiny world with what training needs: rows of `train`, and minimum-jerk reaches that are the same short ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from dextron_bench.reaches import sources
from tests.helpers import tiny_benchmark
from tests.helpers.short_reaches import SOURCE

TRAIN = pd.DataFrame(
    [("train", *tiny_benchmark.SOLVED[0]), ("train", *tiny_benchmark.SOLVED[1])], columns=tiny_benchmark.COLUMNS
)
TOY = f"{Path(__file__).with_name('toy_learner.py')}:Toy"
MINJERK_TOY, TRANSFER = TOY.replace(":Toy", ":MinjerkToy"), TOY.replace(":Toy", ":ToyTransfer")
TIMES = {"timing.jsonl", "provenance.json"}  # Files that say when and where, so that two runs may differ.


def write(folder: Path) -> Path:
    """Writes splits as they ship, of two sources."""
    tiny_benchmark.write(folder, pd.concat([tiny_benchmark.ROWS, TRAIN]))
    catalogue = json.loads((folder / "splits.json").read_text())
    (folder / "splits.json").write_text(json.dumps({**catalogue, "minjerk": catalogue[tiny_benchmark.NAME]}))
    (folder / "splits-minjerk.parquet").write_bytes((folder / f"splits-{tiny_benchmark.NAME}.parquet").read_bytes())
    return folder


def install(folder: Path, put: Callable[[object, str, object], None]) -> None:
    """Makes them the shipped ones."""
    tiny_benchmark.install(folder, put)
    put(sources, "SOURCES", {**sources.SOURCES, "minjerk": lambda: SOURCE})


def contents(folder: Path) -> dict[str, bytes]:
    """Files that must be the same however often a run was killed; of a result, all but where it was made."""
    found = {}
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.name not in TIMES and file.suffix != ".rrd":
            content = file.read_bytes()
            if file.name == "result.json":
                content = json.dumps(json.loads(content) | {"provenance": None}).encode()
            found[str(file.relative_to(folder))] = content
    return found
