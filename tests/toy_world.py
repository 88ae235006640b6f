"""The tiny world with what training needs: rows of `train`, and minimum-jerk reaches that are the same short ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import tiny
from brief import SOURCE

from dextron_bench.reaches import sources

TRAIN = pd.DataFrame([("train", *tiny.SOLVED[0]), ("train", *tiny.SOLVED[1])], columns=tiny.COLUMNS)
TOY = f"{Path(__file__).with_name('toy_learner.py')}:Toy"
HOMELY, HEIR = TOY.replace(":Toy", ":Homely"), TOY.replace(":Toy", ":ToyHeir")
TIMES = {"timing.jsonl", "provenance.json"}  # Files that say when and where, so that two runs may differ.


def write(folder: Path) -> Path:
    """Writes splits as they ship, of two sources."""
    tiny.write(folder, pd.concat([tiny.ROWS, TRAIN]))
    catalogue = json.loads((folder / "splits.json").read_text())
    (folder / "splits.json").write_text(json.dumps({**catalogue, "minjerk": catalogue[tiny.NAME]}))
    (folder / "splits-minjerk.parquet").write_bytes((folder / f"splits-{tiny.NAME}.parquet").read_bytes())
    return folder


def install(folder: Path, put: Callable[[object, str, object], None]) -> None:
    """Makes them the shipped ones."""
    tiny.install(folder, put)
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
