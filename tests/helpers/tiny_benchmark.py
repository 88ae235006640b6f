"""A benchmark of a few short artificial reaches that replaces the shipped one, in this process or in a new one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd

from dextron_bench.reaches import sources
from dextron_bench.runs import result_files
from dextron_bench.splits import loading
from dextron_bench.splits.loading import _catalogue, _table, split_digest
from tests.helpers.short_reaches import SOURCE

NAME = "synthetic"  # The name of the source; the command line accepts it.
COLUMNS = ["split", "reach", "offset_x", "offset_y", "duration_noise", "gain", "critical", "window"]
SOLVED = (  # From a search; each expert scores 20.
    ("b", -0.0321889692488226, -0.009330561323649136, 0.8723991971151619, 1.4573334860056075, 0.2244222635564128, 0.1),
    ("a", -0.024768541718822548, -0.02119268710746776, 0.63213533472851, 1.211950160077924, 0.2662680106143978, 0.1),
)
FALLS = ("b", 0.02, 0.06, -0.4, 1.2, 0.5, 0.0)  # The hand knocks the bottle over after 40 steps.
ROWS = pd.DataFrame(
    [("val", *SOLVED[0]), ("test", *SOLVED[1]), ("test", *SOLVED[0]), ("unseen-reach", *SOLVED[0]), ("open", *FALLS)],
    columns=COLUMNS,
)
COMMAND = Path(__file__).with_name("tiny_command.py")


def write(folder: Path, rows: pd.DataFrame = ROWS, table: str = f"splits-{NAME}.parquet") -> Path:
    """Writes a table of splits into a folder, and adds them to its catalogue; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    rows.to_parquet(folder / table)
    groups = rows.groupby("split", sort=False)
    entry = {str(name): {"rows": len(group), "digest": split_digest(group)} for name, group in groups}
    catalogue = folder / "splits.json"
    known = json.loads(catalogue.read_text())[NAME] if catalogue.exists() else {}
    catalogue.write_text(json.dumps({NAME: known | entry}))
    return folder


def install(folder: Path, put: Callable[[object, str, object], None] = setattr) -> None:
    """Replaces the shipped splits and their source; `put` sets attributes, as `setattr` does.

    No published result has played these splits, so that none is read.
    """
    put(loading, "files", lambda package: folder)
    put(result_files, "published_results", lambda: folder / "published")
    put(sources, "SOURCES", {**sources.SOURCES, NAME: lambda: SOURCE})
    forget()


@contextmanager
def working_folder(folder: Path, rows: pd.DataFrame = ROWS) -> Iterator[Path]:
    """Makes a folder the working folder, and replaces the shipped splits by `rows`, which it keeps in data/."""
    import pytest  # Commands of the tiny benchmark work without it.

    try:
        with pytest.MonkeyPatch.context() as patch:
            install(write(folder / "data", rows), patch.setattr)
            patch.chdir(folder)
            yield folder
    finally:
        forget()


def forget() -> None:
    """Clears the caches, so that splits are read again."""
    _catalogue.cache_clear()
    _table.cache_clear()


def start(folder: Path, *arguments: str | Path, **environment: str) -> subprocess.Popen[str]:
    """Starts the command line with the splits in a folder, in a new process, with buffers as users have them."""
    command = [sys.executable, str(COMMAND), str(folder), *map(str, arguments)]
    left_out = ("DEXTRON_", "PYTHONUNBUFFERED")
    inherited = {key: value for key, value in os.environ.items() if not key.startswith(left_out)}
    return subprocess.Popen(
        command, env={**inherited, **environment}, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
