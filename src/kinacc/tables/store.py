"""Tables in files: DataFrames in and out, held to their schema, whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from kinacc.errors import InputError, Problem, first_few, gathered, input_error, refuse
from kinacc.tables import sums
from kinacc.tables.columns import Column, Columns, texts
from kinacc.tables.contract import ARTEFACTS, PROVENANCE_KEYS

_ARROW_TYPES = {
    "float": pa.float64(),
    "int": pa.int64(),
    "int8": pa.int8(),
    "bool": pa.bool_(),
    "text": pa.string(),
}
_MOST_BYTES = 400_000_000  # of a table in memory: a file of few bytes may unpack to many


def read_table(path: Path | str) -> pd.DataFrame:
    """Read a table of results.

    Parameters
    ----------
    path
        A Parquet file, such as ``results/tracker/residuals.parquet``.

    Returns
    -------
    DataFrame
        Null is NaN, and numbers of a column with nulls are float64. Units and meanings of the
        columns: ``kinacc show FILE --describe``.

    Raises
    ------
    InputError
        Where the file is absent, damaged, no Parquet or too large.
    """
    return read_arrow(path).to_pandas()


def to_table(
    artefact: str, columns: pd.DataFrame | Mapping[str, Any], provenance: Mapping[str, object]
) -> pa.Table:
    """Hold a table to the schema of an artefact.

    Parameters
    ----------
    artefact
        Name of the table in the contract.
    columns
        Values by column. NaN and None become null; absent optional columns are null throughout.
    provenance
        Metadata of the table: ``PROVENANCE_KEYS``.

    Returns
    -------
    pyarrow.Table
        Of the artefact's schema, with unit and meaning of every column.

    Raises
    ------
    InputError
        Naming every column that is missing, unknown or of another length, null where none may be,
        number that is not finite, and value of a wrong type.
    """
    contract, where = ARTEFACTS[artefact], f"table {artefact}"
    problems = []
    if {*provenance} != {*PROVENANCE_KEYS}:
        message = f"has provenance {', '.join(provenance)}"
        problems.append(Problem(where, message, ", ".join(PROVENANCE_KEYS)))
    known = contract.in_file(columns)
    names = [column.name for column in known]
    problems += [
        Problem(f"{where}, column {name}", "not in the contract", ", ".join(names))
        for name in columns
        if name not in names
    ]
    count = max((len(columns[name]) for name in columns), default=0)
    arrays = []
    for column in known:
        with gathered(problems):
            place = f"{where}, column {column.name}"
            arrays.append(_to_arrow(column, columns.get(column.name), count, place))
    refuse(problems, f"{artefact} does not fit its contract")
    fields = [
        pa.field(
            column.name,
            _ARROW_TYPES[column.kind],
            nullable=column.nullable,
            metadata={"unit": column.unit, "meaning": column.meaning},
        )
        for column in known
    ]
    marks = {key: str(provenance[key]) for key in PROVENANCE_KEYS}
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields, marks))


def _to_arrow(column: Column, values: Any, count: int, where: str) -> pa.Array:
    """Values in the type of a column, nulls where none are stated. InputError if unfit."""
    kind, is_text = _ARROW_TYPES[column.kind], column.kind == "text"
    if values is None and not column.optional:
        raise input_error(where, "missing")
    if isinstance(values, pd.Series):
        values = values.to_numpy(object if is_text else None)
    try:
        values = [None] * count if values is None else values
        array = pa.array(values, kind if is_text else None, from_pandas=True)
        if pa.types.is_string(array.type) and not is_text:
            raise TypeError("text in place of numbers")
        array = array.cast(kind)
    except (pa.ArrowException, TypeError, ValueError, OverflowError) as error:
        raise input_error(where, str(error).split("\n")[0], column.kind) from None
    if len(array) != count:
        raise input_error(where, "columns of different lengths", f"{count} rows")
    null = np.asarray(array.is_null())
    if null.any() and not column.nullable:
        raise input_error(where, f"null or NaN in {rows(null)}", "a value in every row")
    if column.kind == "float" and (infinite := np.isinf(np.asarray(array))).any():
        raise input_error(where, f"infinite in {rows(infinite)}", "finite numbers")
    if null.any() and not is_text:  # the same bytes below every null: digests depend on them
        array = pa.array(np.asarray(array.fill_null(0)), kind, mask=null)
    return array


def digest_of(artefact: str, columns: pd.DataFrame | Mapping[str, Any]) -> str:
    """Digest of the columns of an artefact, whatever made them."""
    table = to_table(artefact, columns, dict.fromkeys(PROVENANCE_KEYS, "-"))
    written = pa.BufferOutputStream()
    with pa.ipc.new_stream(written, table.schema) as stream:
        stream.write_table(table)
    return sums.digest(written.getvalue())


def content_of(table: pa.Table) -> bytes:
    """Bytes of a table's file, which has a checksum for each of its pages."""
    written = pa.BufferOutputStream()
    pq.write_table(table, written, compression="zstd", version="2.6", write_page_checksum=True)
    return written.getvalue().to_pybytes()


def read(path: Path | str) -> Columns:
    """Columns of a table as arrays, see :func:`columns_in`. Raises InputError as `read_table`."""
    return columns_in(read_arrow(path))


def columns_in(table: pa.Table) -> Columns:
    """Columns as arrays: a null number is NaN (a nullable column is float64), a null text None."""
    return {field.name: _to_numpy(field, table[place]) for place, field in enumerate(table.schema)}


def _to_numpy(field: pa.Field, column: pa.ChunkedArray) -> np.ndarray:
    if _is_number(field.type):
        return np.array(column, np.float64 if field.nullable or column.null_count else None)
    return np.array(column) if pa.types.is_boolean(field.type) else texts(column.to_pylist())


def _is_number(kind: pa.DataType) -> bool:
    return pa.types.is_integer(kind) or pa.types.is_floating(kind)


def read_arrow(path: Path | str, content: bytes | None = None, any_type: bool = False) -> pa.Table:
    """The Arrow table in a file, or in its ``content`` where that has been read already.

    Checksums of pages are held to the pages. Columns hold numbers or text, unless ``any_type``.
    Errors as of :func:`read`.
    """
    with _opened(path, content) as file:
        schema, footer = file.schema_arrow, file.metadata
        known = {pa.string(), pa.large_string(), pa.bool_(), pa.null()}
        refuse(
            Problem(f"{path}, column {field.name}", f"is of type {field.type}", "numbers, text")
            for field in (() if any_type else schema)
            if not _is_number(field.type) and field.type not in known
        )
        # No text is longer than all of a group; one that is held once may stand in every row.
        groups = map(footer.row_group, range(footer.num_row_groups))
        longest = max((item.total_byte_size for item in groups), default=0)
        at_once = _MOST_BYTES // (10 * (longest + 16 * max(len(schema), 1)))
        batches, held = [], 0
        for batch in file.iter_batches(min(at_once, 65_536) or 1, use_threads=False):
            batches.append(batch)
            held += max(batch.nbytes, 8 * batch.num_rows * len(schema))
            if held > _MOST_BYTES:
                message = f"holds more than {_MOST_BYTES // 1_000_000} MB"
                raise input_error(str(path), message, "a smaller table")
        table = pa.Table.from_batches(batches, schema)
        table.validate(full=True)  # texts may hold bytes that are no text
        return table


def row_count(path: Path | str) -> int:
    """Number of rows of a table's file; InputError if absent or not Parquet."""
    with _opened(path) as file:
        return file.metadata.num_rows


def read_metadata(path: Path | str) -> dict[str, str]:
    """Provenance of a table's file as text, the same for all tables of a stage.

    Raises InputError if the file is absent or not Parquet.
    """
    with _opened(path) as file:
        raw = file.schema_arrow.metadata or {}
    return {key.decode(errors="replace"): raw[key].decode(errors="replace") for key in raw}


@contextmanager
def _opened(path: Path | str, content: bytes | None = None) -> Iterator[pq.ParquetFile]:
    """A Parquet file; what is wrong with it, within the block too, becomes an InputError."""
    try:
        if content is None and os.path.exists(path) and not os.path.isfile(path):
            raise input_error(str(path), "is no file", "a Parquet file")  # a pipe has no end
        source = path if content is None else pa.BufferReader(content)
        with pq.ParquetFile(source, page_checksum_verification=True) as file:
            yield file
    except InputError as error:
        fix = sums.remake(path)
        raise InputError([replace(item, fix=fix) for item in error.problems]) from None
    except FileNotFoundError:
        raise input_error(str(path), "no such file", "a Parquet file") from None
    except (pa.ArrowException, OSError, ValueError, OverflowError) as error:
        reason = (str(error) or type(error).__name__).splitlines()[0]
        message = f"not a readable Parquet file: {reason}"
        raise input_error(str(path), message, fix=sums.remake(path)) from None


def rows(mask: np.ndarray) -> str:
    """The first rows (from 0) a mask marks, in words."""
    results = np.flatnonzero(mask)
    return f"row{'s' if results.size > 1 else ''} {first_few(results.tolist())}"
