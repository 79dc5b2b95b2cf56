"""Digests of what stands in a table, whatever file and program hold it."""

from __future__ import annotations

import hashlib
import struct

import numpy as np
import pyarrow as pa

from kinacc.errors import InputError, Problem

_BEGINNING = b"kinacc columns 1\n"
_KINDS = ("double", "int64", "int8", "string")


def columns_digest(table: pa.Table) -> str:
    """SHA-256 of a table's columns: 64 hexadecimal digits, of the values alone.

    It is taken over these bytes, one after the other; a *count* is a whole number in 8 bytes, and
    every number has its least significant byte first:

    1. the text ``kinacc columns 1`` and a line feed; the counts of columns and of rows;
    2. for each column, in the table's order: name, type (``double``, ``int64``, ``int8`` or
       ``string``) and unit (empty where none is stated), each as the count of its bytes in UTF-8
       and these bytes; one byte, 1 where the column may be null and else 0;
    3. of the same column which rows have a value: a bit for each, 1 for a value and 0 for null,
       eight in a byte from the least significant one on, the last byte filled up with zeros;
    4. of the same column the values: IEEE 754 numbers in 8 bytes, NaN as 7ff8000000000000 and -0
       apart from 0; whole numbers as two's complement in 8 bytes or, of type int8, in one; texts
       as a count of bytes in UTF-8 for each row, and then these bytes of all rows. Where there is
       null, the number or the count is 0.

    Raises InputError for columns of other types.
    """
    digest = hashlib.sha256(_BEGINNING + struct.pack("<2Q", table.num_columns, table.num_rows))
    for field, column in zip(table.schema, table.columns, strict=True):
        kind, unit = str(field.type), (field.metadata or {}).get(b"unit", b"")
        if kind not in _KINDS:
            allowed = ", ".join(_KINDS)
            raise InputError(Problem(f"column {field.name}", f"is of type {kind}", allowed))
        for text in (field.name.encode(), kind.encode(), unit):
            digest.update(struct.pack("<Q", len(text)) + text)
        digest.update(struct.pack("<B", field.nullable))
        values = column.chunk(0) if column.num_chunks == 1 else _whole(column)
        null = ~_valid(values)
        digest.update(np.packbits(~null, bitorder="little").data)
        for part in _texts(values, null) if kind == "string" else _numbers(values, null):
            digest.update(np.ascontiguousarray(part).data)
    return digest.hexdigest()


def _whole(column: pa.ChunkedArray) -> pa.Array:
    return pa.concat_arrays(column.chunks) if column.num_chunks else pa.array([], column.type)


def _valid(values: pa.Array) -> np.ndarray:
    """Which rows (n,) are not null; from the bits, because is_valid imports more of pyarrow."""
    bits = values.buffers()[0]
    if bits is None or not values.null_count:
        return np.ones(len(values), dtype=bool)
    unpacked = np.unpackbits(np.frombuffer(bits, np.uint8), bitorder="little")
    return unpacked[values.offset : values.offset + len(values)].astype(bool)


def _numbers(values: pa.Array, null: np.ndarray) -> tuple[np.ndarray, ...]:
    dtype = np.dtype(values.type.to_pandas_dtype()).newbyteorder("<")
    numbers = _of_buffer(values.buffers()[1], dtype, values.offset, len(values))
    if null.any():
        numbers = np.where(null, dtype.type(0), numbers)
    if dtype.kind == "f" and np.isnan(numbers).any():
        numbers = np.where(np.isnan(numbers), np.nan, numbers)
    return (numbers.astype(dtype, copy=False),)


def _texts(values: pa.Array, null: np.ndarray) -> tuple[np.ndarray, ...]:
    _, places, letters = values.buffers()
    ends = _of_buffer(places, np.dtype("<i4"), values.offset, len(values) + 1 if places else 0)
    lengths = np.diff(ends)
    if lengths[null].any():  # null over letters, as Arrow allows
        return _texts(pa.array(values.to_pylist(), pa.string()), null)
    first, last = (int(ends[0]), int(ends[-1])) if len(ends) else (0, 0)
    return lengths.astype("<u8"), _of_buffer(letters, np.dtype(np.uint8), first, last - first)


def _of_buffer(buffer: pa.Buffer | None, dtype: np.dtype, first: int, count: int) -> np.ndarray:
    if buffer is None or not count:
        return np.empty(0, dtype)
    return np.frombuffer(buffer, dtype, count, first * dtype.itemsize)
