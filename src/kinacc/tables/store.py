"""Reading and writing the tables: cast to the contract, provenance, all or nothing."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.tables import sums
from kinacc.tables.atomic import write_together
from kinacc.tables.columns import (
    JOINTS_MAX,
    JOINTS_MIN,
    Artefact,
    Column,
    Columns,
    joint_count,
    texts,
)
from kinacc.tables.contract import (
    ARTEFACTS,
    PROVENANCE_KEYS,
)

_ARROW_TYPES = {
    "float": pa.float64(),
    "int": pa.int64(),
    "int8": pa.int8(),
    "bool": pa.bool_(),
    "text": pa.string(),
}
_MOST_VALUES = 100_000_000
_MOST_BYTES = 500_000_000  # of the texts of a column
Read = TypeVar("Read")


class TableToWrite(NamedTuple):
    """One table for :func:`write_all`: where, which artefact, its columns, its provenance."""

    path: Path | str
    artefact: str
    columns: Mapping[str, Any]
    provenance: Mapping[str, object]


def artefact_named(name: str) -> Artefact:
    """The contract of an artefact; InputError if there is none of that name."""
    if name not in ARTEFACTS:
        raise InputError(Problem(f"artefact {name!r}", "not in the contract", ", ".join(ARTEFACTS)))
    return ARTEFACTS[name]


def arrow_schema(
    artefact: str,
    joints: int = 0,
    provenance: Mapping[str, object] | None = None,
    given: Iterable[str] | None = None,
) -> pa.Schema:
    """Arrow schema of an artefact for an arm of ``joints`` joints, unit and meaning included.

    ``given``: names of columns there are, where some may be absent.
    """
    contract = artefact_named(artefact)
    columns = contract.for_joints(joints) if given is None else contract.in_file(joints, given)
    fields = [
        pa.field(
            column.name,
            _ARROW_TYPES[column.kind],
            nullable=column.nullable,
            metadata={"unit": column.unit, "meaning": column.meaning},
        )
        for column in columns
    ]
    if provenance is None:
        return pa.schema(fields)
    return pa.schema(fields, {key: str(provenance[key]) for key in PROVENANCE_KEYS})


def to_table(
    artefact: str, columns: Mapping[str, Any], provenance: Mapping[str, object]
) -> pa.Table:
    """Cast columns (each of shape (rows,)) to the artefact's Arrow table.

    NaN and None become null where the contract allows null; so do optional columns not given. Its
    metadata are the provenance. Raises InputError naming every missing or unknown column,
    null where none may be, number that is not finite, and value of a wrong type.
    """
    contract = artefact_named(artefact)
    where = f"table {artefact}"
    problems = _provenance_problems(where, provenance)
    joints = joint_count(contract, columns)
    if contract.has_joints and not JOINTS_MIN <= joints <= JOINTS_MAX:
        problems.append(
            Problem(where, f"speaks of {joints} joints", f"q1.. of {JOINTS_MIN} to {JOINTS_MAX}")
        )
    names = [column.name for column in contract.for_joints(joints)]
    wanted = contract.in_file(joints, columns)
    problems += [
        Problem(f"{where}, column {name}", "not in the contract", ", ".join(names))
        for name in columns
        if name not in names
    ]
    arrays = []
    for column in wanted:
        place = f"{where}, column {column.name}"
        if column.name not in columns and not column.optional:
            problems.append(Problem(place, "missing"))
            continue
        values = columns.get(column.name)
        if values is None:
            values = [None] * len(next(iter(columns.values())))
        array, found = _to_arrow(place, column, values)
        problems += found
        arrays.append(array)
    lengths = {c.name: len(a) for c, a in zip(wanted, arrays, strict=False) if a is not None}
    if not problems and len(set(lengths.values())) > 1:
        problems.append(Problem(where, f"columns of different lengths: {lengths}"))
    refuse(problems, f"{artefact} does not fit its contract")
    schema = arrow_schema(artefact, joints, provenance, columns)
    return pa.Table.from_arrays(arrays, schema=schema)


def digest_of(artefact: str, columns: Mapping[str, Any]) -> str:
    """Digest of the columns of an artefact, whatever made them."""
    table = to_table(artefact, columns, dict.fromkeys(PROVENANCE_KEYS, "-"))
    written = pa.BufferOutputStream()
    with pa.ipc.new_stream(written, table.schema) as stream:
        stream.write_table(table)
    return sums.digest(written.getvalue())


def write(
    path: Path | str,
    artefact: str,
    columns: Mapping[str, Any],
    provenance: Mapping[str, object],
) -> None:
    """Write one table, or leave what was there untouched; see :func:`to_table` for errors."""
    write_all([TableToWrite(path, artefact, columns, provenance)])


def write_all(tables: Sequence[TableToWrite]) -> None:
    """Write several tables so that either all of them appear or none.

    Every table is cast and written under a temporary name before the first one is renamed.
    """
    write_together(
        {
            table.path: content_of(to_table(table.artefact, table.columns, table.provenance))
            for table in tables
        }
    )


def content_of(table: pa.Table) -> bytes:
    """Bytes of a table's file, which has a checksum for each of its pages."""
    written = pa.BufferOutputStream()
    pq.write_table(table, written, compression="zstd", version="2.6", write_page_checksum=True)
    return written.getvalue().to_pybytes()


def read(path: Path | str, any_type: bool = False) -> Columns:
    """Columns of a table: float64 and whole numbers as numpy, text as object arrays.

    Null numbers are NaN (a nullable whole number is therefore float64), null text is None. Columns
    of other types are refused, or object arrays where ``any_type`` says so. Raises InputError if
    the file is absent or not Parquet, or if its columns are not those that it was written with.
    """
    try:
        return columns_in(read_table(path, any_type=any_type))
    except (OverflowError, ValueError) as error:  # no UTF-8, or a day that no calendar has
        what = f"not a readable Parquet file: {error}"
        raise InputError(Problem(str(path), what, fix=remake(path))) from None
    except InputError as error:
        raise InputError([replace(each, fix=remake(path)) for each in error.problems]) from None


def read_table(path: Path | str, content: bytes | None = None, any_type: bool = False) -> pa.Table:
    """The table in a file, or in its ``content`` where that has been read already.

    Checksums of pages are held to the pages. ``any_type`` and errors as of :func:`read`.
    """
    return _open(path, lambda file: _unpacked(file, path, any_type), content)


def _unpacked(file: pq.ParquetFile, path: Path | str, any_type: bool) -> pa.Table:
    """All of a file, if its footer says that it can be held: few bytes may unpack to many."""
    rows, columns = file.metadata.num_rows, file.metadata.num_columns
    if rows * columns > _MOST_VALUES:
        allowed = f"at most {_MOST_VALUES} values"
        raise InputError(Problem(str(path), f"{rows} rows of {columns} columns", allowed))
    refuse(
        Problem(f"{path}, column {field.name}", f"is of type {field.type}", "numbers, text")
        for field in file.schema_arrow
        if not (any_type or pa.types.is_integer(field.type) or pa.types.is_floating(field.type))
        and field.type not in (pa.string(), pa.large_string(), pa.bool_(), pa.null())
    )
    _refuse_long_texts(file, path)
    return file.read(use_threads=False)


def _refuse_long_texts(file: pq.ParquetFile, path: Path | str) -> None:
    """Raise InputError where texts, each held once in the file, are too much when repeated.

    No text is longer than what all of a group's take, so that most files need no second look.
    """
    footer = file.metadata
    for place, field in enumerate(file.schema_arrow):
        if field.type not in (pa.string(), pa.large_string()):
            continue
        chunks = [footer.row_group(each).column(place) for each in range(footer.num_row_groups)]
        longest = max((each.total_uncompressed_size for each in chunks), default=0)
        if footer.num_rows * longest <= _MOST_BYTES:
            continue
        held = 0
        rows = max(_MOST_BYTES // (10 * longest), 1)
        for batch in file.iter_batches(rows, columns=[field.name], use_threads=False):
            held += batch.nbytes
            if held > _MOST_BYTES:
                what = f"texts of more than {_MOST_BYTES // 1_000_000} MB"
                raise InputError(Problem(f"{path}, column {field.name}", what, "short texts"))


def remake(path: Path | str) -> str:
    """What to do about an artefact that is of no use, for the message of who came upon it."""
    return f"rm {shlex.quote(str(path))}, then run the workflow again"


def read_schema(path: Path | str) -> pa.Schema:
    """Arrow schema of a table's file; InputError if absent or not Parquet."""
    return _open(path, lambda file: file.schema_arrow)


def read_metadata(path: Path | str) -> dict[str, str]:
    """Provenance of a table's file as text, the same for all tables of a stage.

    Raises InputError if the file is absent or not Parquet.
    """
    raw = read_schema(path).metadata or {}
    return {key.decode(errors="replace"): raw[key].decode(errors="replace") for key in raw}


def _open(
    path: Path | str, opening: Callable[[pq.ParquetFile], Read], content: bytes | None = None
) -> Read:
    if content is None and os.path.exists(path) and not os.path.isfile(path):
        raise InputError(Problem(str(path), "is no file", "a Parquet file"))  # a pipe has no end
    try:
        source = path if content is None else pa.BufferReader(content)
        with pq.ParquetFile(source, page_checksum_verification=True) as file:
            return opening(file)
    except FileNotFoundError:
        raise InputError(Problem(str(path), "no such file")) from None
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(Problem(str(path), f"not a readable Parquet file: {reason}")) from None


def columns_in(table: pa.Table) -> Columns:
    """The columns of a table as :func:`read` gives them."""
    names = zip(table.schema, table.columns, strict=True)
    return {field.name: _to_numpy(field, column) for field, column in names}


def _to_numpy(field: pa.Field, column: pa.ChunkedArray) -> np.ndarray:
    if pa.types.is_boolean(field.type):
        return np.array(column.to_numpy(zero_copy_only=False))
    if not (pa.types.is_integer(field.type) or pa.types.is_floating(field.type)):
        return texts(column.to_pylist())
    if field.nullable or column.null_count:
        return column.cast(pa.float64()).to_numpy().astype(np.float64)
    return np.array(column.to_numpy())


def _provenance_problems(where: str, provenance: Mapping[str, object]) -> list[Problem]:
    missing = [key for key in PROVENANCE_KEYS if key not in provenance]
    unknown = [key for key in provenance if key not in PROVENANCE_KEYS]
    allowed = ", ".join(PROVENANCE_KEYS)
    return [Problem(where, f"provenance lacks {key}", allowed) for key in missing] + [
        Problem(where, f"provenance has an unknown key {key!r}", allowed) for key in unknown
    ]


def _to_arrow(place: str, column: Column, values: Any) -> tuple[pa.Array | None, list[Problem]]:
    if column.kind == "text":
        return _text_to_arrow(place, column, values)
    try:
        numbers = np.asarray(
            [np.nan if value is None else value for value in values]
            if not isinstance(values, np.ndarray) or values.dtype == object
            else values
        )
        exact = numbers if numbers.dtype.kind in "iu" else None
        numbers = numbers.astype(np.float64)
    except (TypeError, ValueError):
        return None, [Problem(place, "holds something that is not a number", column.kind)]
    if numbers.ndim != 1:
        return None, [Problem(place, f"has shape {numbers.shape}", "one value per row")]
    null = np.isnan(numbers)
    problems = []
    if null.any() and not column.nullable:
        problems.append(Problem(place, f"null or NaN in {rows(null)}", "a number in every row"))
    if np.isinf(numbers).any():
        problems.append(Problem(place, f"infinite in {rows(np.isinf(numbers))}", "finite numbers"))
    if column.kind == "float":
        return (None if problems else _array(numbers, null, pa.float64())), problems
    whole = null | (numbers == np.round(numbers))
    if not whole.all():
        first = numbers[~whole][0]
        problems.append(Problem(place, f"{first:g} in {rows(~whole)}", "whole numbers"))
    limits = {"int8": (-128, 127), "bool": (0, 1), "int": (-(2.0**63), 2.0**63 - 1025)}
    low, high = limits[column.kind]
    beyond = ~null & ((numbers < low) | (numbers > high))
    if beyond.any() and not problems:
        problems.append(Problem(place, f"too large for {column.kind} in {rows(beyond)}"))
    if problems:
        return None, problems
    integers = exact if exact is not None else np.where(null, 0, numbers)
    return _array(integers, null, _ARROW_TYPES[column.kind]), []


def _array(values: np.ndarray, null: np.ndarray, kind: pa.DataType) -> pa.Array:
    """Arrow array of numbers."""
    return pa.array(np.where(null, 0, values).astype(kind.to_pandas_dtype()), kind, mask=null)


def _text_to_arrow(
    place: str, column: Column, values: Any
) -> tuple[pa.Array | None, list[Problem]]:
    texts = [_as_text(value) for value in values]
    wrong = np.array([not (value is None or isinstance(value, str)) for value in texts], dtype=bool)
    null = np.array([value is None for value in texts], dtype=bool)
    if wrong.any():
        first = texts[int(np.argmax(wrong))]
        return None, [Problem(place, f"{first!r} in {rows(wrong)}", "text")]
    if null.any() and not column.nullable:
        return None, [Problem(place, f"null in {rows(null)}", "text in every row")]
    return pa.array(texts, pa.string()), []


def _as_text(value: Any) -> Any:
    """A text as str, None and NaN as None, anything else unchanged."""
    if value is None or isinstance(value, str):
        return None if value is None else str(value)
    return None if isinstance(value, float) and np.isnan(value) else value


def rows(mask: np.ndarray) -> str:
    """The first rows (from 0) a mask marks, in words."""
    rows = np.flatnonzero(mask)
    return f"row{'s' if rows.size > 1 else ''} {first_few(rows.tolist())}"
