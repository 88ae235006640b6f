"""Tables of episodes from strangers: reads them within limits, and compares their rows with the splits."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from dextron_bench.processes import limited_process
from dextron_bench.splits.loading import Split
from dextron_bench.storage.printable import first_hidden
from dextron_bench.submissions import table_process
from dextron_bench.submissions.bundle import BadBundle
from dextron_bench.submissions.table_process import SETTING
from dextron_bench.world import model, task

LISTS = {"actions": task.STEP_LIMIT, "final": model.STATE}  # With the largest length of each.
LONGEST = 1000  # Characters of a text.
TEXT = 2**20  # [bytes] of the unpacked texts of a column in one row group.
GROUPS = 64  # Row groups; their texts are read one group at a time.
MEMORY = 3 * limited_process.GIBIBYTE // 4  # [bytes] of address space, for a table, of the process that reads it.
SECONDS = 60.0  # [s] that it may take.


def read(file: Path, splits: Sequence[Split]) -> pd.DataFrame:
    """The table in a file, which a separate process reads and checks; raises BadBundle, OSError."""
    with file.open("rb"):  # Raises OSError here, if the file cannot be read.
        pass
    rows = sum(len(split) for split in splits)
    limits = json.dumps({"rows": rows, "groups": GROUPS, "text": TEXT, "longest": LONGEST, "lists": LISTS})
    done = limited_process.run(table_process.__file__, [str(file), limits], b"", MEMORY, SECONDS)
    if done.code == 1 and done.output:
        raise BadBundle(f"{file.name} {ast.literal_eval(done.output.decode())}")
    if done.code != 0:
        raise BadBundle(f"{file.name} cannot be read as a table (the process that read it {done.ending})")
    return pa.ipc.open_stream(done.output).read_all().to_pandas()


def faults(table: pd.DataFrame, splits: Sequence[Split]) -> Iterator[str]:
    """A line for each row that is missing, duplicate, or of another split, setting or number of actions.

    Also a line for a text with a character that cannot be printed: the board keeps the reasons of failures.
    """
    if characters := [hidden for reason in set(table["failure"]) if (hidden := first_hidden(reason))]:
        yield f"has the character {min(characters)!r} in column 'failure'"
    for name in sorted(set(table["split"]) - {split.name for split in splits}):
        yield f"{name} is not a split that ranks methods"
    for split in splits:
        rows = table[table["split"] == split.name]
        yield from (f"{split.name}: {fault}" for fault in _faults(rows, split))


def _faults(rows: pd.DataFrame, split: Split) -> Iterator[str]:
    """The faults of the rows of one split."""
    if set(rows["digest"]) - {split.digest}:
        yield f"was played on another version of the split, not on {split.digest[:8]}"
    counts = rows["row"].value_counts()
    if duplicates := sorted(counts[counts > 1].index):
        yield f"row {duplicates[0]} appears {counts[duplicates[0]]} times"
    if missing := sorted(set(range(len(split))) - set(counts.index)):
        yield f"row {missing[0]} is missing"
    for row in rows[rows["row"].between(0, len(split) - 1)].itertuples():
        setting = split.case(row.row).setting  # pyright: ignore[reportArgumentType, reportCallIssue]
        if tuple(getattr(row, name) for name in SETTING) != tuple(getattr(setting, name) for name in SETTING):
            yield f"row {row.row} has another setting than the split"
        actions = np.asarray(row.actions, float)
        if len(actions) != row.length or not (np.abs(actions) <= 1.0).all():
            yield f"row {row.row} has actions that are not {row.length} numbers in [-1, 1]"
