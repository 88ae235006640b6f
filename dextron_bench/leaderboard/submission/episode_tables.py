"""Tables of episodes from strangers: reads them within size limits, and compares their rows with the splits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, product
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from dextron_bench.leaderboard.submission.bundle import BadBundle
from dextron_bench.splits.loading import Split
from dextron_bench.world import model, task

SETTING = ("reach", "offset_x", "offset_y", "duration_noise")
FLAGS, NUMBERS = ("success", "terminated", "truncated"), (*SETTING[1:], "score", "closing_lag")
TEXTS, COUNTS = ("split", "digest", "reach", "failure", "cause", "trace"), ("row", "length")
LISTS = {"actions": task.STEP_LIMIT, "final": model.STATE}  # With the largest length of each.
LONGEST = 1000  # Characters of a text.
TEXT = 2**20  # [bytes] of the unpacked texts of a column in one row group.
GROUPS = 64  # Row groups; their texts are read one group at a time.
MAY_LACK = {"closing_lag"}  # Empty if the hand never closed.
COLUMNS = {*FLAGS, *NUMBERS, *TEXTS, *COUNTS, *LISTS}


def read(file: Path, splits: Sequence[Split]) -> pd.DataFrame:
    """The table in a file, after checks of its columns and of its size; raises BadBundle, OSError."""
    rows = sum(len(split.cases) for split in splits)
    try:
        parquet = pq.ParquetFile(file, read_dictionary=list(TEXTS))
        if parquet.metadata.num_rows != rows:
            raise BadBundle(f"{file.name} has {parquet.metadata.num_rows} episodes, but the splits have {rows}")
        _check_columns(file, parquet.schema_arrow)
        _check_size(file, parquet.metadata, rows)
        return _read_bounded(file, parquet)
    except KeyError as error:  # A column of texts is looked up when the file is opened.
        raise BadBundle(f"{file.name} should have the columns of this version; it lacks {error.args[0]!r}") from error
    except (pa.ArrowException, OverflowError, UnicodeDecodeError) as error:
        raise BadBundle(f"{file.name} cannot be read as a table ({error})") from error


def faults(table: pd.DataFrame, splits: Sequence[Split]) -> Iterator[str]:
    """A line for each row that is missing, duplicate, or of another split, setting or number of actions."""
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
    if missing := sorted(set(range(len(split.cases))) - set(counts.index)):
        yield f"row {missing[0]} is missing"
    for row in rows[rows["row"].between(0, len(split.cases) - 1)].itertuples():
        setting = split.cases[row.row].setting  # pyright: ignore[reportArgumentType, reportCallIssue]
        if tuple(getattr(row, name) for name in SETTING) != tuple(getattr(setting, name) for name in SETTING):
            yield f"row {row.row} has another setting than the split"
        actions = np.asarray(row.actions, float)
        if len(actions) != row.length or not (np.abs(actions) <= 1.0).all():
            yield f"row {row.row} has actions that are not {row.length} numbers in [-1, 1]"


def _read_bounded(file: Path, parquet: pq.ParquetFile) -> pd.DataFrame:
    """The table; checks texts while a dictionary holds each of them once, however many rows repeat it."""
    for group, name in product(range(parquet.num_row_groups), TEXTS):
        for chunk in parquet.read_row_group(group, columns=[name]).column(name).chunks:
            if max((len(text or "") for text in chunk.dictionary.to_pylist()), default=0) > LONGEST:
                raise BadBundle(f"{file.name} has texts of more than {LONGEST} characters in column {name!r}")
    table = parquet.read(columns=sorted(COLUMNS))
    if empty := [name for name in sorted(COLUMNS - MAY_LACK) if table.column(name).null_count]:
        raise BadBundle(f"{file.name} has an episode without its {empty[0]}")
    lengths = (chunk.value_lengths().to_pylist() for chunk in table.column("final").chunks)
    if set(chain.from_iterable(lengths)) != {model.STATE}:
        raise BadBundle(f"{file.name} has a last state without exactly {model.STATE} numbers")
    for name in TEXTS:
        strings = table.column(name).cast(pa.string())
        table = table.set_column(table.schema.get_field_index(name), name, strings)
    return table.to_pandas()


def _check_columns(file: Path, schema: pa.Schema) -> None:
    """Raises BadBundle if names or types of the columns are not exactly the expected ones."""
    duplicates = {name for name in schema.names if schema.names.count(name) > 1}
    if differing := sorted(COLUMNS ^ set(schema.names) | duplicates):
        raise BadBundle(f"{file.name} should have the columns of this version; it differs in {differing[0]!r}")
    tests = {
        **dict.fromkeys(FLAGS, pa.types.is_boolean),
        **dict.fromkeys(NUMBERS, pa.types.is_float64),
        **dict.fromkeys(COUNTS, pa.types.is_int64),
        **dict.fromkeys(TEXTS, pa.types.is_dictionary),
        **dict.fromkeys(LISTS, lambda kind: pa.types.is_list(kind) and pa.types.is_float64(kind.value_type)),
    }
    for name, test in tests.items():
        if not test(schema.field(name).type):
            raise BadBundle(f"{file.name} has {schema.field(name).type} in column {name!r}")


def _check_size(file: Path, metadata: pq.FileMetaData, rows: int) -> None:
    """Raises BadBundle for lists and texts that would fill the memory, by the sizes that the file states."""
    if metadata.num_row_groups > GROUPS:
        raise BadBundle(f"{file.name} has {metadata.num_row_groups} row groups, more than {GROUPS}")
    values: dict[str, int] = dict.fromkeys(COLUMNS, 0)
    for group in range(metadata.num_row_groups):
        for place in range(metadata.num_columns):
            column = metadata.row_group(group).column(place)
            name = column.path_in_schema.partition(".")[0]
            values[name] += column.num_values
            if name in TEXTS and column.total_uncompressed_size > TEXT:
                raise BadBundle(f"{file.name} has texts of {column.total_uncompressed_size} bytes in column {name!r}")
    for name, count in values.items():
        if count > rows * LISTS.get(name, 1):
            raise BadBundle(f"{file.name} has {count} values in column {name!r}, too many for {rows} episodes")
