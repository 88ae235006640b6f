"""Digest of a recording's content: files with equal content have equal digests, even if their bytes differ."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import numpy as np
import pyarrow as pa
from rerun.chunk import Chunk

ROW_ID = "rerun.controls.RowId"  # Random, and not part of the content.


def digest(lines: Iterable[str]) -> str:
    """SHA-256, hexadecimal, of the lines of a recording's chunks; their order does not matter."""
    return hashlib.sha256("\n".join(sorted(lines)).encode()).hexdigest()


def lines(chunks: Iterable[Chunk]) -> Iterable[str]:
    """One line for each column of the chunks: entity, name and SHA-256 of the values."""
    for chunk in chunks:
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if name != ROW_ID:
                yield f"{chunk.entity_path} {name} {hashlib.sha256(b''.join(_pieces(column))).hexdigest()}"


def _pieces(column: pa.Array) -> Iterable[bytes | memoryview]:
    """The bytes of a column: its type, the lengths of its lists, and its values."""
    kind = column.type
    yield f"{kind} {len(column)} {column.null_count};".encode()
    if pa.types.is_list(kind):
        yield np.diff(column.offsets.to_numpy()).tobytes()
        yield from _pieces(column.flatten())
    elif pa.types.is_fixed_size_list(kind):
        yield from _pieces(column.flatten())
    elif pa.types.is_struct(kind):
        for part in column.flatten():
            yield from _pieces(part)
    elif pa.types.is_union(kind):
        yield column.type_codes.to_numpy().tobytes()
        for index in range(kind.num_fields):
            yield from _pieces(column.field(index))
    elif column.null_count == 0 and pa.types.is_primitive(kind) and kind.bit_width >= 8:
        width = kind.bit_width // 8
        yield memoryview(column.buffers()[1])[column.offset * width : (column.offset + len(column)) * width]
    else:
        yield repr(column.to_pylist()).encode()
