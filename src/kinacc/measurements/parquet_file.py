"""A Parquet file of measurements as a table; its footer is looked at before it is unpacked."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.measurements.table import (
    ALLOWED,
    MOST_BYTES,
    MOST_CELLS,
    MOST_COLUMNS,
    MOST_ROWS,
    SMALLER,
    RawTable,
    doubled_in,
)


def load(path: Path) -> RawTable:
    """The rows of the file. Raises InputError where it is none, too large, or has no rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            schema, problem = file.schema_arrow, _too_large(str(path), file.metadata)
        doubled = doubled_in(schema.names)
        if doubled and not problem:
            problem = Problem(str(path), f"column names given twice: {doubled}")
        if problem:
            raise InputError(problem)
        flat = [field.name for field in schema if not pa.types.is_nested(field.type)]
        # The same text in a million rows is held once.
        texts = [name for name in flat if _is_text(schema.field(name).type)]
        with pq.ParquetFile(path, read_dictionary=texts) as file:
            table = file.read(columns=flat)
            rows = table.num_rows if flat else file.metadata.num_rows
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(Problem(str(path), f"not a Parquet file: {reason}")) from None
    if not rows:
        raise InputError(Problem(str(path), "the table has no rows", "at least one row"))
    columns = {
        field.name: _cells(table.column(field.name), str(path))
        if field.name in flat
        else [f"<{field.type}>"] * rows  # one cell of a list may hold a million values
        for field in schema
    }
    return RawTable(str(path), columns, np.arange(1, rows + 1), ".")


def _is_text(kind) -> bool:
    import pyarrow as pa

    return pa.types.is_string(kind) or pa.types.is_large_string(kind)


def _too_large(where: str, footer) -> Problem | None:
    """What the footer of a Parquet file says of its size, before anything is unpacked."""
    rows, width, groups = footer.num_rows, footer.num_columns, footer.num_row_groups
    what = ""
    if rows > MOST_ROWS or width > MOST_COLUMNS or rows * width > MOST_CELLS:
        what = f"{rows} rows of {width} columns"
    elif groups > MOST_ROWS // 100:
        what = f"{groups} groups of rows"
    else:
        size = sum(footer.row_group(number).total_byte_size for number in range(groups))
        what = f"{size / 1e6:.0f} MB" if size > MOST_BYTES else ""
    return Problem(where, what, ALLOWED, SMALLER) if what else None


def _cells(column, where: str) -> list:
    """Values of a Parquet column; the column's type as text where Python has no such value.

    Raises InputError where a few long texts, repeated, are more than could be worked through.
    """
    import pyarrow as pa

    try:
        if not pa.types.is_dictionary(column.type):
            return column.to_pylist()
        cells: list = []
        for chunk in column.chunks:
            words = chunk.dictionary.to_pylist()
            places = chunk.indices.to_pylist()
            lengths = [len(word) if isinstance(word, str) else 0 for word in words]
            size = sum(lengths[place] for place in places if place is not None)
            if size > MOST_BYTES:
                what = f"texts of {size / 1e6:.0f} MB in one column"
                raise InputError(Problem(where, what, ALLOWED, SMALLER))
            cells += [None if place is None else words[place] for place in places]
        return cells
    except (pa.ArrowException, ArithmeticError, LookupError, ValueError):
        # A date outside the calendar, text that is not UTF-8.
        return [f"<{column.type}>"] * len(column)
