"""A script that reads the table of episodes of a stranger, and writes it as an Arrow stream (see `episode_tables`).

It runs in a process of its own with limits on memory and time, because a Parquet file can state sizes that fill the
memory. It imports nothing of this package, so that it starts quickly. Its arguments are the file and the limits as
JSON. It prints the fault and ends with code 1 if the table is not one that a run writes.
"""

from __future__ import annotations

import json
import sys
from itertools import chain, product
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from dextron_bench.errors import BadInput

SETTING = ("reach", "offset_x", "offset_y", "duration_noise")
FLAGS, NUMBERS = ("success", "terminated", "truncated"), (*SETTING[1:], "score", "closing_lag")
TEXTS, COUNTS = ("split", "digest", "reach", "failure", "cause", "trace"), ("row", "length")
LISTS = ("actions", "final")
MAY_LACK = {"closing_lag"}  # Empty if the hand never closed.
COLUMNS = {*FLAGS, *NUMBERS, *TEXTS, *COUNTS, *LISTS}


class RefusedTable(BadInput):
    """A table that no run writes; the message does not name the file."""


def read(file: Path, limits: dict[str, Any]) -> pa.Table:
    """The table in a file, after checks of its columns and of its size; raises RefusedTable, OSError.

    `limits` are `rows`, `groups` of rows, bytes of `text` in a column of a group, characters of the `longest` text, and
    the most numbers of each list in `lists`.
    """
    try:
        parquet = pq.ParquetFile(file, read_dictionary=list(TEXTS))
        if parquet.metadata.num_rows != limits["rows"]:
            raise RefusedTable(f"has {parquet.metadata.num_rows} episodes, but the splits have {limits['rows']}")
        _check_columns(parquet.schema_arrow)
        _check_size(parquet.metadata, limits)
        return _read_bounded(parquet, limits)
    except KeyError as error:  # A column of texts is looked up when the file is opened.
        raise RefusedTable(f"should have the columns of this version; it lacks {error.args[0]!r}") from error
    except MemoryError as error:
        raise RefusedTable("cannot be read as a table (it needs too much memory)") from error
    except (pa.ArrowException, OverflowError, UnicodeDecodeError) as error:
        raise RefusedTable(f"cannot be read as a table ({error})") from error


def _read_bounded(parquet: pq.ParquetFile, limits: dict[str, Any]) -> pa.Table:
    """The table; checks texts while a dictionary holds each of them once, however many rows repeat it."""
    for group, name in product(range(parquet.num_row_groups), TEXTS):
        for chunk in parquet.read_row_group(group, columns=[name], use_threads=False).column(name).chunks:
            if max((len(text or "") for text in chunk.dictionary.to_pylist()), default=0) > limits["longest"]:
                raise RefusedTable(f"has texts of more than {limits['longest']} characters in column {name!r}")
    table = parquet.read(columns=sorted(COLUMNS), use_threads=False)
    if empty := [name for name in sorted(COLUMNS - MAY_LACK) if table.column(name).null_count]:
        raise RefusedTable(f"has an episode without its {empty[0]}")
    lengths = (chunk.value_lengths().to_pylist() for chunk in table.column("final").chunks)
    if set(chain.from_iterable(lengths)) != {limits["lists"]["final"]}:
        raise RefusedTable(f"has a last state without exactly {limits['lists']['final']} numbers")
    for name in TEXTS:
        strings = table.column(name).cast(pa.string())
        table = table.set_column(table.schema.get_field_index(name), name, strings)
    return table.replace_schema_metadata(None)  # A table that pandas writes has metadata, which pandas would follow.


def _check_columns(schema: pa.Schema) -> None:
    """Raises RefusedTable if names or types of the columns are not exactly the expected ones."""
    duplicates = {name for name in schema.names if schema.names.count(name) > 1}
    if differing := sorted(COLUMNS ^ set(schema.names) | duplicates):
        raise RefusedTable(f"should have the columns of this version; it differs in {differing[0]!r}")
    tests = {
        **dict.fromkeys(FLAGS, pa.types.is_boolean),
        **dict.fromkeys(NUMBERS, pa.types.is_float64),
        **dict.fromkeys(COUNTS, pa.types.is_int64),
        **dict.fromkeys(TEXTS, pa.types.is_dictionary),
        **dict.fromkeys(LISTS, lambda kind: pa.types.is_list(kind) and pa.types.is_float64(kind.value_type)),
    }
    for name, test in tests.items():
        if not test(schema.field(name).type):
            raise RefusedTable(f"has {schema.field(name).type} in column {name!r}")


def _check_size(metadata: pq.FileMetaData, limits: dict[str, Any]) -> None:
    """Raises RefusedTable for lists and texts that would fill the memory, by the sizes that the file states."""
    if metadata.num_row_groups > limits["groups"]:
        raise RefusedTable(f"has {metadata.num_row_groups} row groups, more than {limits['groups']}")
    values: dict[str, int] = dict.fromkeys(COLUMNS, 0)
    for group in range(metadata.num_row_groups):
        for place in range(metadata.num_columns):
            column = metadata.row_group(group).column(place)
            name = column.path_in_schema.partition(".")[0]
            values[name] += column.num_values
            if name in TEXTS and column.total_uncompressed_size > limits["text"]:
                raise RefusedTable(f"has texts of {column.total_uncompressed_size} bytes in column {name!r}")
    for name, count in values.items():
        if count > limits["rows"] * limits["lists"].get(name, 1):
            raise RefusedTable(f"has {count} values in column {name!r}, too many for {limits['rows']} episodes")


def main(file: str, limits: str) -> int:
    """Writes the table to standard output, or prints the fault; returns the exit code."""
    pa.set_cpu_count(1)
    try:
        table = read(Path(file), json.loads(limits))
    except RefusedTable as error:
        print(ascii(str(error)))
        return 1
    with pa.ipc.new_stream(sys.stdout.buffer, table.schema) as stream:
        stream.write_table(table)
    return 0
