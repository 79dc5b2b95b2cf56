"""A measurement file as a table of named columns: text, a workbook, Parquet, a robot's program.

Text is parted by the ``csv`` module: pandas fills rows that are cut off without a message.
"""

from __future__ import annotations

import csv
import re
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TextIO

import numpy as np
import pandas as pd
import pyarrow as pa

from kinacc.config import json_files
from kinacc.errors import InputError, input_error
from kinacc.measurements import robot_programs
from kinacc.measurements.features import by_feature
from kinacc.measurements.grid import Row, tabled
from kinacc.measurements.layout import ANGLE, FEATURES, LENGTH, SPHERICAL, Layout
from kinacc.measurements.spherical import cartesian
from kinacc.measurements.table import RawTable, frame
from kinacc.tables import store

BLANKS = "blanks"
GROUPS, POINT = ("Collection", "Group"), "Point"  # columns of a list of points without names
EXCEL = (".xlsx", ".xlsm")
_OTHERS = (".xls", ".xlsb", ".ods", ".pdf", ".docx")
_LESS = "give the rows and columns of the measurements alone"
_KINDS = "a CSV, text, Excel (.xlsx) or Parquet file"
# What is held at once; calibrations are made from some hundred to some ten thousand rows.
MOST_ROWS, MOST_COLUMNS, MOST_CELLS = 1_000_000, 10_000, 10_000_000
_MOST_LINES = MOST_ROWS + 10_000  # titles and the like beside
MOST_BYTES, _MOST_UNPACKED = 500_000_000, 150_000_000  # a sheet of a million cells has some 40 MB
_WITH_BRACKETS = re.compile(r"(?:\{[^{}]*\}|\[(?:[^\[\]]|\[[^\[\]]*\])*\]|\S)+")


def load(path: str | Path, layout: Layout) -> RawTable:
    """Read a file that is written so. Raises InputError where it is missing, empty or ragged."""
    path = Path(path)
    refuse_other_files(path, layout.source)
    if (table := as_it_is(path)) is not None:
        return table
    if path.suffix.lower() in EXCEL:
        sheet, sheet_rows = next(iter(rows_of_sheets(path, layout.sheet).items()))
        table = tabled(f"{path}, sheet {sheet!r}", sheet_rows, layout, sheet=True)
    else:
        refuse_large(path)
        with opened(path, layout.encoding) as stream:
            rows = _limited(rows_of_lines(stream, layout.delimiter, str(path)), str(path))
            table = tabled(str(path), rows, layout)
    return reshaped(robot_programs.expanded(table), layout)


def reshaped(table: RawTable, layout: Layout) -> RawTable:
    """A row per reading with x, y and z, of rows per axis or of two angles and a distance."""
    if layout.layout == FEATURES:
        return by_feature(table)
    return cartesian(table, layout.directions) if layout.layout == SPHERICAL else table


def as_it_is(path: Path) -> RawTable | None:
    """The table of a file that has one layout only: Parquet, JSON, a robot's program; else None."""
    kind = path.suffix.lower()
    if kind in (".parquet", ".pq"):
        return _of_parquet(path)
    return _of_json(path) if kind == ".json" else robot_programs.read(path)


def refuse_other_files(path: Path, source: str | None = None) -> None:
    """Raise InputError where there is no file, or one that is none of those that are read."""
    if not path.is_file():
        origin = f"the data comes from: {source}" if source else "check measurements.file.path"
        raise input_error(str(path), "no such file", _KINDS, origin)
    if path.suffix.lower() in _OTHERS:
        fix = "save it as .xlsx or export it as CSV"
        raise input_error(str(path), "is of a kind that is not read", _KINDS, fix)


def opened(path: Path, encoding: str) -> TextIO:
    """A text file in one of our encodings, without its byte order mark.

    Bytes that are none of its characters become U+FFFD.
    """
    codec = "cp1252" if encoding == "latin-1" else encoding
    stream = open(path, newline="", encoding=codec, errors="replace")  # noqa: SIM115 the caller's
    if stream.read(1) != "\ufeff":
        stream.seek(0)
    return stream


def _refuse_too_much(path: str, amount: str) -> None:
    allowed = f"at most {MOST_ROWS} rows, {MOST_COLUMNS} columns, {MOST_CELLS} cells, 500 MB"
    raise input_error(path, amount, allowed, _LESS)


def _refuse_shape(path: str, rows: int, columns: int, cells: int) -> None:
    if rows > MOST_ROWS or columns > MOST_COLUMNS or cells > MOST_CELLS:
        _refuse_too_much(path, f"{rows} rows of {columns} columns")


def refuse_large(path: Path) -> None:
    """Raise InputError where a text has too many bytes or lines."""
    if (size := path.stat().st_size) > MOST_BYTES:
        _refuse_too_much(str(path), f"{size / 1e6:.0f} MB")
    if (lines := path.read_bytes().count(b"\n")) > _MOST_LINES:
        _refuse_too_much(str(path), f"{lines} lines")


def rows_of_lines(lines: Iterable[str], delimiter: str, path: str) -> Iterator[Row]:
    """Rows of the lines of a text, blank ones too."""
    if delimiter == BLANKS:
        for number, line in enumerate(lines, 1):
            text = line.replace("={", " {")  # P1={E6AXIS: ..}
            brackets = "{" in text or "[" in text
            yield number, _WITH_BRACKETS.findall(text) if brackets else text.split()
        return
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        for cells in reader:
            yield reader.line_num, cells
    except csv.Error as error:
        where = f"{path}: line {reader.line_num}"
        allowed = "cells of at most 131072 characters, each quotation mark with its second"
        raise input_error(where, f"cannot be read: {error}", allowed) from None


def _limited(rows: Iterable[Row], path: str) -> Iterator[Row]:
    """The rows, as long as they are not too many. Raises InputError then."""
    held = 0
    for count, row in enumerate(rows):
        held += (width := len(row[1]))
        _refuse_shape(path, count, width, held)
        yield row


def rows_of_sheets(
    path: Path, wanted: str | None = None, most: int = MOST_ROWS
) -> dict[str, list[Row]]:
    """The first rows of the sheets of a workbook that are shown, or of one of them.

    Raises InputError where the file is none, is locked, or is too large when unpacked.
    """
    where = str(path)
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(part.file_size for part in archive.infolist())
        if size > _MOST_UNPACKED:
            _refuse_too_much(where, f"{size / 1e6:.0f} MB")
        with pd.ExcelFile(path, engine="openpyxl") as book:
            sheets = [s.title for s in book.book.worksheets if s.sheet_state == "visible"]
            if not sheets:
                raise input_error(where, "has no sheet with cells", "a sheet with a table")
            if wanted and wanted not in sheets:
                message = f"has no sheet {wanted!r} that is shown"
                raise input_error(where, message, ", ".join(sheets))
            cells = pd.read_excel(
                book,
                [wanted] if wanted else sheets,
                header=None,
                dtype=object,
                na_filter=False,
                nrows=most + 1,
            )
    except InputError:
        raise
    except Exception as error:  # a damaged part of a workbook raises whatever it meets
        reason = (str(error) or type(error).__name__).splitlines()[0][:200]
        message, fix = f"cannot be read as a workbook: {reason}", "save it as .xlsx or CSV"
        raise input_error(where, message, "an .xlsx file without a password", fix) from None
    return {sheet: _rows_of_sheet(where, table) for sheet, table in cells.items()}


def _rows_of_sheet(where: str, cells: pd.DataFrame) -> list[Row]:
    """The rows of a sheet that are not blank, each with its number, of equal length."""
    _refuse_shape(where, len(cells), cells.shape[1], cells.size)
    rows = [[_cell(value) for value in row] for row in cells.itertuples(index=False)]
    there = np.array([[cell != "" for cell in row] for row in rows], ndmin=2)
    width = np.flatnonzero(there.any(axis=0)).max(initial=-1) + 1
    return [(n + 1, rows[n][:width]) for n in np.flatnonzero(there.any(axis=1)).tolist()]


def _cell(value: object) -> object:
    if isinstance(value, str):
        return value.strip()
    return str(value).upper() if isinstance(value, bool) else value


def _of_parquet(path: Path) -> RawTable:
    """The rows of a Parquet file; a nested column, or one that Python cannot hold, by its type."""
    try:
        table = store.read_arrow(path, any_type=True)
    except InputError as error:
        raise InputError([replace(problem, fix=_LESS) for problem in error.problems]) from None
    where, rows = str(path), table.num_rows
    _refuse_shape(where, rows, table.num_columns, rows * table.num_columns)
    names = table.column_names
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise input_error(where, f"column names given twice: {', '.join(doubled)}")
    if not rows:
        raise input_error(where, "the table has no rows", "at least one row")
    columns, units = {}, {}
    for field, column in zip(table.schema, table.columns, strict=True):
        cells = [f"<{field.type}>"] * rows
        if not pa.types.is_nested(field.type):  # one cell of a list may hold a million values
            with suppress(pa.ArrowException, ArithmeticError, LookupError, ValueError):
                cells = column.to_pylist()  # but a date outside the calendar
        name, unit = field.name, (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
        if unit in {**ANGLE, **LENGTH}:
            whole = f"{name}_{unit}"  # joints of our tables have the unit beside their name
            name = whole if re.fullmatch(r"q\d", name) and whole not in names else name
            units[name] = unit
        columns[name] = cells
    return RawTable(where, frame(columns), np.arange(1, rows + 1), units=units)


def _of_json(path: Path) -> RawTable:
    """The rows of an answer that a command gave as JSON."""
    try:
        content = json_files.bytes_of(path)
        rows = json_files.values_of(content, str(path))["rows"]
        columns = {name: [row.get(name) for row in rows] for name in rows[0]}
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError):
        allowed = "a table of rows, as commands write with -o NAME.json"
        raise input_error(str(path), "holds no rows", allowed) from None
    return RawTable(str(path), frame(columns), np.arange(1, len(rows) + 1))
