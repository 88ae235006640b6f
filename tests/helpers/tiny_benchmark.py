"""A benchmark of a few short made-up reaches in place of the shipped one, in this process or in one of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from dextron_bench.reaches import sources
from dextron_bench.splits import loading
from dextron_bench.splits.loading import _catalogue, _table, split_digest
from tests.helpers.short_reaches import SOURCE

NAME = "synthetic"  # What the source is called, since the command line knows it.
COLUMNS = ["split", "reach", "offset_x", "offset_y", "duration_noise", "gain", "critical", "window"]
SOLVED = (  # Found by a search; each expert scores 20.
    ("b", -0.0432621503294626, -0.01466825592348343, 0.4574125439673816, 1.4146469215542943, 0.16870179317709627, 0.1),
    ("a", -0.0256286214908538, -0.0306174763715841, 1.5043816401333401, 1.4684286438473184, 0.2672967412483991, 0.1),
)
FALLS = ("b", 0.02, 0.06, -0.4, 1.2, 0.5, 0.0)  # The hand knocks the bottle over after 40 steps.
ROWS = pd.DataFrame(
    [("val", *SOLVED[0]), ("test", *SOLVED[1]), ("test", *SOLVED[0]), ("unseen-reach", *SOLVED[0]), ("open", *FALLS)],
    columns=COLUMNS,
)
COMMAND = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv.pop(1))
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from tests.helpers import tiny_benchmark
tiny_benchmark.install(Path(sys.argv.pop(1)))
from dextron_bench.cli.main import main
sys.exit(main())
"""


def write(folder: Path, rows: pd.DataFrame = ROWS) -> Path:
    """Writes splits as they ship, catalogue and table, into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    rows.to_parquet(folder / f"splits-{NAME}.parquet")
    groups = rows.groupby("split", sort=False)
    entry = {str(name): {"rows": len(group), "digest": split_digest(group)} for name, group in groups}
    (folder / "splits.json").write_text(json.dumps({NAME: entry}))
    return folder


def install(folder: Path, put: Callable[[object, str, object], None] = setattr) -> None:
    """Makes the splits in a folder the shipped ones, and the made-up reaches their source."""
    put(loading, "files", lambda package: folder)
    put(sources, "SOURCES", {**sources.SOURCES, NAME: lambda: SOURCE})
    forget()


def forget() -> None:
    """Makes splits be read again."""
    _catalogue.cache_clear()
    _table.cache_clear()


def start(folder: Path, *words: str | Path, **environment: str) -> subprocess.Popen[str]:
    """Starts the command line on the splits in a folder."""
    command = [sys.executable, "-c", COMMAND, str(Path(__file__).parents[2]), str(folder), *map(str, words)]
    inherited = {key: value for key, value in os.environ.items() if not key.startswith("DEXTRON_")}
    return subprocess.Popen(
        command, env={**inherited, **environment}, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
