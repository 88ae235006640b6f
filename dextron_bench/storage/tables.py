"""Tables in Parquet files with a digest of their values, which Parquet itself does not have."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.storage import atomic, hashing
from dextron_bench.storage.records import FULL_RETURN

DIGEST = "digest"  # In the attributes of a table, which pandas keeps in the file.


def texts(column: pd.Series) -> bool:
    """True if every value is text."""
    return all(isinstance(value, str) for value in column)


def flags(column: pd.Series) -> bool:
    """True if every value is True or False."""
    return column.dtype == bool


def counts(column: pd.Series) -> bool:
    """True if every value is a whole number, 0 or more."""
    return column.dtype.kind in "iu" and bool((column >= 0).all())


def finite(column: pd.Series) -> bool:
    """True if every value is a finite number."""
    return column.dtype.kind in "iuf" and bool(np.isfinite(column).all())


def finite_or_missing(column: pd.Series) -> bool:
    """True if every value is a finite number or missing."""
    return bool(column.isna().all()) or (column.dtype.kind in "iuf" and finite(column.dropna()))


def returns(column: pd.Series) -> bool:
    """True if every value is the return of an episode."""
    return finite(column) and bool(column.between(0.0, FULL_RETURN).all())


Columns = Mapping[str, Callable[[pd.Series], bool]]
SETTING: Columns = {"reach": texts, "offset_x": finite, "offset_y": finite, "duration_noise": finite}
EPISODES: Columns = {  # Of a run.
    **SETTING,
    **dict.fromkeys(("split", "digest", "failure", "cause"), texts),
    "row": counts,
    "length": counts,
    "success": flags,
    "score": returns,
    "closing_lag": finite_or_missing,
}
CASES: Columns = {**SETTING, "split": texts, "gain": finite, "critical": finite}  # Of fresh settings.
DRAWS: Columns = {  # Of a block of a search.
    **SETTING, "gain": finite, "critical": finite, "score": returns, "length": finite_or_missing
}  # fmt: skip


class BadTable(BadInput):
    """A file that is not the table that it should be; the message says why, and does not name the file."""


class OtherColumns(BadTable):
    """A table that can be read, but does not have the columns that this version writes."""


def write(file: Path, table: pd.DataFrame, **options: Any) -> None:
    """Writes a table atomically, with a digest of its values; `options` are of `DataFrame.to_parquet`."""
    marked = table.copy(deep=False)
    marked.attrs = {DIGEST: digest(table)}
    atomic.write_atomically(file, lambda part: marked.to_parquet(part, **options))


def read(file: Path, columns: Columns) -> pd.DataFrame:
    """The table in a file, whose columns have the expected values; raises BadTable, OtherColumns, OSError.

    A table without a digest, of an earlier version, is accepted.
    """
    try:
        table = pd.read_parquet(file)
        stored, table.attrs = table.attrs.get(DIGEST), {}
        actual = digest(table)
    except MemoryError as error:
        raise MemoryError(f"{file}: {error}") from error
    except Exception as error:  # Damaged bytes raise errors of any type.
        if isinstance(error, OSError) and error.errno is not None:  # Of the system, and not of the decoder.
            raise
        raise BadTable(" ".join(str(error).split())[:200] or type(error).__name__) from error
    for name, check in columns.items():
        if name not in table:
            raise OtherColumns(f"it lacks the column {name!r}")
        if not check(table[name]):
            raise OtherColumns(f"its column {name!r} has values that do not belong there")
    if stored not in (None, actual):
        raise BadTable("its values differ from the digest that it carries")
    return table


def read_own(file: Path, columns: Columns) -> pd.DataFrame:
    """The table in a file of this package, as `read` does; raises DamagedFile, OSError."""
    try:
        return read(file, columns)
    except OtherColumns as error:
        raise atomic.OtherForm(file, error) from error
    except BadTable as error:
        raise atomic.DamagedFile(file, error) from error


def digest(table: pd.DataFrame) -> str:
    """SHA-256 of names and values of a table, in order."""
    return hashing.digest(*(part for name in table for part in (str(name).encode(), _bytes(table[name]))))


def _bytes(column: pd.Series) -> bytes:
    """The values of a column; numbers that are equal, and texts and lists that are equal, give equal bytes."""
    if column.dtype.kind in "biuf":
        return np.ascontiguousarray(column, "<f8").tobytes()
    return hashing.digest(*map(_value_bytes, column)).encode()


def _value_bytes(value: Any) -> bytes:
    if isinstance(value, str):
        return value.encode()
    if hasattr(value, "__len__"):
        return np.ascontiguousarray(value, "<f8").tobytes()
    return b"" if pd.isna(value) else repr(float(value)).encode()
