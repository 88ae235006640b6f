"""Tables of episodes from strangers: read within bounds, and held against the splits that they claim to be of."""

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
LISTS = {"actions": task.STEP_LIMIT, "final": model.STATE}  # And the most numbers of each.
LONGEST = 1000  # Letters of a text.
TEXT = 2**20  # [bytes] of the texts of a column in one row group, unpacked.
GROUPS = 64  # Row groups, whose texts are read one group at a time.
MAY_LACK = {"closing_lag"}  # Where no hand closed.
COLUMNS = {*FLAGS, *NUMBERS, *TEXTS, *COUNTS, *LISTS}


def read(file: Path, wanted: Sequence[Split]) -> pd.DataFrame:
    """The table in a file, of a known form and no larger than one of the splits can be; raises BadBundle, OSError."""
    rows = sum(len(split.cases) for split in wanted)
    try:
        found = pq.ParquetFile(file, read_dictionary=list(TEXTS))
        if found.metadata.num_rows != rows:
            raise BadBundle(f"{file.name} has {found.metadata.num_rows} episodes where the splits have {rows}")
        _check_form(file, found.schema_arrow)
        _check_size(file, found.metadata, rows)
        return _bounded(file, found)
    except KeyError as error:  # A text's column, which is asked for when the file is opened.
        raise BadBundle(f"{file.name} should have the columns of this version; it lacks {error.args[0]!r}") from error
    except (pa.ArrowException, OverflowError, UnicodeDecodeError) as error:
        raise BadBundle(f"{file.name} is no table that can be read ({error})") from error


def faults(table: pd.DataFrame, wanted: Sequence[Split]) -> Iterator[str]:
    """What is wrong with which rows are there and what they say was played, a line each."""
    for name in sorted(set(table["split"]) - {split.name for split in wanted}):
        yield f"{name} is none of the splits that rank methods"
    for split in wanted:
        rows = table[table["split"] == split.name]
        yield from (f"{split.name}: {what}" for what in _faults(rows, split))


def _faults(rows: pd.DataFrame, split: Split) -> Iterator[str]:
    if set(rows["digest"]) - {split.digest}:
        yield f"was played on another version of the split than {split.digest[:8]}"
    counts = rows["row"].value_counts()
    if twice := sorted(counts[counts > 1].index):
        yield f"row {twice[0]} is there {counts[twice[0]]} times"
    if missing := sorted(set(range(len(split.cases))) - set(counts.index)):
        yield f"row {missing[0]} is missing"
    for row in rows[rows["row"].between(0, len(split.cases) - 1)].itertuples():
        setting = split.cases[row.row].setting  # pyright: ignore[reportArgumentType, reportCallIssue]
        if tuple(getattr(row, name) for name in SETTING) != tuple(getattr(setting, name) for name in SETTING):
            yield f"row {row.row} was played in another setting than the split's"
        actions = np.asarray(row.actions, float)
        if len(actions) != row.length or not (np.abs(actions) <= 1.0).all():
            yield f"row {row.row} has actions that are not {row.length} numbers in [-1, 1]"


def _bounded(file: Path, found: pq.ParquetFile) -> pd.DataFrame:
    """The table; texts are looked at while each is held once, however many rows repeat it."""
    for group, name in product(range(found.num_row_groups), TEXTS):
        for chunk in found.read_row_group(group, columns=[name]).column(name).chunks:
            if max((len(text or "") for text in chunk.dictionary.to_pylist()), default=0) > LONGEST:
                raise BadBundle(f"{file.name} has texts of more than {LONGEST} letters in column {name!r}")
    table = found.read(columns=sorted(COLUMNS))
    if empty := [name for name in sorted(COLUMNS - MAY_LACK) if table.column(name).null_count]:
        raise BadBundle(f"{file.name} has an episode without its {empty[0]}")
    lengths = (chunk.value_lengths().to_pylist() for chunk in table.column("final").chunks)
    if set(chain.from_iterable(lengths)) != {model.STATE}:
        raise BadBundle(f"{file.name} has a last state that is not {model.STATE} numbers")
    for name in TEXTS:
        plain = table.column(name).cast(pa.string())
        table = table.set_column(table.schema.get_field_index(name), name, plain)
    return table.to_pandas()


def _check_form(file: Path, schema: pa.Schema) -> None:
    twice = {name for name in schema.names if schema.names.count(name) > 1}
    if lacking := sorted(COLUMNS ^ set(schema.names) | twice):
        raise BadBundle(f"{file.name} should have the columns of this version; it differs in {lacking[0]!r}")
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


def _check_size(file: Path, told: pq.FileMetaData, rows: int) -> None:
    """Refuses lists and texts that would fill the memory, by the sizes that the file tells."""
    if told.num_row_groups > GROUPS:
        raise BadBundle(f"{file.name} has {told.num_row_groups} row groups; {GROUPS} are plenty")
    values: dict[str, int] = dict.fromkeys(COLUMNS, 0)
    for group in range(told.num_row_groups):
        for place in range(told.num_columns):
            column = told.row_group(group).column(place)
            name = column.path_in_schema.partition(".")[0]
            values[name] += column.num_values
            if name in TEXTS and column.total_uncompressed_size > TEXT:
                raise BadBundle(f"{file.name} has texts of {column.total_uncompressed_size} bytes in column {name!r}")
    for name, count in values.items():
        if count > rows * LISTS.get(name, 1):
            raise BadBundle(f"{file.name} has {count} values in column {name!r}, more than {rows} episodes can have")
