"""A measurement file as a table of named columns: text, a workbook, Parquet, a robot's program.

Text is parted by the ``csv`` module and not by pandas, which fills rows that are cut off without a
word.
"""

from __future__ import annotations

import csv
import re
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.measurements import robot_programs
from kinacc.measurements.grid import Row, Words, refuse_too_much, tabled
from kinacc.measurements.layout import FEATURES, SPHERICAL, Layout
from kinacc.measurements.table import ALLOWED, MOST_BYTES, MOST_ROWS, SMALLER, RawTable

BLANKS = "blanks"
GROUPS, POINT = ("Collection", "Group"), "Point"  # columns of a list of points without names
PARQUET = (".parquet", ".pq")
EXCEL = (".xlsx", ".xlsm")
_OTHERS = {
    ".xls": "a workbook of the old Excel format",
    ".xlsb": "a binary workbook",
    ".ods": "an OpenDocument sheet",
    ".pdf": "a PDF file",
    ".docx": "a text document",
}
_LOOKED_AT = 100_000  # characters
_KINDS = "a CSV, text, Excel (.xlsx) or Parquet file"
_MOST_LINES = MOST_ROWS + 10_000  # titles and the like beside
_LAST_ROW = 1_048_576  # that a workbook can have
_MOST_UNPACKED = 150_000_000  # bytes; a sheet of a million cells has some 40 MB


def load(path: str | Path, layout: Layout | None = None, source: str | None = None) -> RawTable:
    """Read a file that is written so. Raises InputError where it is missing, empty or ragged.

    ``source``: where the data comes from, said when the file is missing.
    """
    path, layout = Path(path), layout or Layout()
    refuse_other_files(path, source)
    if path.suffix.lower() in PARQUET:
        table = _of_parquet(path)
    elif path.suffix.lower() in EXCEL:
        table = _of_workbook(path, layout)
    elif (program := robot_programs.read(path)) is not None:
        return program
    else:
        table = tabled(str(path), rows_of_text(path, layout), layout)
        if layout.encoding == "utf-8" and any("\ufffd" in name for name in table.columns):
            told = "names of columns hold characters that are not UTF-8: set "
            told += "measurements.file.encoding, such as latin-1 or cp932"
            table = replace(table, notes=(*table.notes, told))
    table = robot_programs.expanded(table)
    if layout.layout == FEATURES:
        from kinacc.measurements.features import by_feature

        return by_feature(table)
    if layout.layout == SPHERICAL:
        from kinacc.measurements.spherical import cartesian

        return cartesian(table, layout.directions)
    return table


def quotes_numbers(path: Path, layout: Layout) -> bool:
    """Whether numbers with the delimiter within them are one cell: in quotes, or in a workbook."""
    if path.suffix.lower() in (*EXCEL, *PARQUET):
        return True
    with opened(path, layout.encoding) as stream:
        text = stream.read(_LOOKED_AT)
    number = rf'"\s*[+\-−]?\d[\d.,\'\s]*{re.escape(layout.delimiter)}\d[\d.,]*\s*"'
    return bool(re.search(number, text))


def refuse_other_files(path: Path, source: str | None = None) -> None:
    """Raise InputError where there is no file, or one that is none of those that are read."""
    suffix = path.suffix.lower()
    if not path.is_file():
        origin = f"the data comes from: {source}" if source else "check measurements.file.path"
        raise InputError(Problem(str(path), "no such file", _KINDS, origin))
    if kind := _OTHERS.get(suffix):
        text = suffix in (".pdf", ".docx")
        fix = "export it as CSV" if text else "save it as .xlsx or as CSV"
        raise InputError(Problem(str(path), f"is {kind}, which is not read", _KINDS, fix))


def opened(path: Path, encoding: str):
    """A text file in one of our encodings; what is none of its characters becomes U+FFFD."""
    codec = {"utf-8": "utf-8-sig", "latin-1": "cp1252"}.get(encoding, encoding)
    return open(path, newline="", encoding=codec, errors="replace")


def refuse_large(path: Path) -> None:
    """Raise InputError where a text has too many bytes or lines."""
    size, lines = path.stat().st_size, 0
    if size <= MOST_BYTES:
        with open(path, "rb") as file:
            lines = sum(chunk.count(b"\n") for chunk in iter(lambda: file.read(1 << 20), b""))
    if size > MOST_BYTES or lines > _MOST_LINES:
        what = f"{lines} lines" if lines else f"{size / 1e6:.0f} MB"
        raise InputError(Problem(str(path), what, ALLOWED, SMALLER))


def rows_of_text(path: Path, layout: Layout) -> Iterator[Row]:
    """Rows of a text file. Raises InputError where there is too much of it."""
    refuse_large(path)
    with opened(path, layout.encoding) as stream:
        yield from _limited(rows_of_lines(stream, layout.delimiter, str(path)), str(path))


def rows_of_lines(lines: Iterable[str], delimiter: str, path: str) -> Iterator[Row]:
    """Rows of the lines of a text, blank ones too."""
    if delimiter == BLANKS:
        for number, line in enumerate(lines, 1):
            yield number, Words(line.removeprefix("\ufeff"))
        return
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        for cells in reader:
            if reader.line_num == 1 and cells:
                cells[0] = cells[0].removeprefix("\ufeff")
            yield reader.line_num, cells
    except csv.Error as error:
        where = f"{path}: line {reader.line_num}"
        allowed = "cells of at most 131072 characters, each quotation mark with its second"
        raise InputError(Problem(where, f"cannot be read: {error}", allowed)) from None


def _limited(rows: Iterable[Row], path: str) -> Iterator[Row]:
    """The rows, as long as they are not too many. Raises InputError then."""
    cells_ = 0
    for count, (line, cells) in enumerate(rows):
        cells_ += len(cells)
        refuse_too_much(path, count, len(cells), cells_)
        yield line, cells


def _of_workbook(path: Path, layout: Layout) -> RawTable:
    """The rows of the sheet, of the first where none is named."""
    with Workbook(path) as book:
        sheet = book.sheets[0] if layout.sheet is None else layout.sheet
        if sheet not in book.sheets:
            where, what = f"{path}: measurements.file.sheet", f"there is no sheet {sheet!r}"
            raise InputError(Problem(where, what, ", ".join(book.sheets)))
        rows = book.rows(sheet)
    from openpyxl.utils import get_column_letter

    width = len(rows[0][1]) if rows else 0
    letters = [get_column_letter(number) for number in range(1, width + 1)]
    return tabled(f"{path}, sheet {sheet!r}", rows, layout, letters)


class Workbook:
    """A workbook that is open to be read; ``sheets`` are the names of those that are shown.

    Raises InputError where it is none, is locked, or is too large when unpacked.
    """

    def __init__(self, path: Path) -> None:
        import openpyxl

        self.path = str(path)
        try:
            with zipfile.ZipFile(path) as archive:
                size = sum(each.file_size for each in archive.infolist())
            if size > _MOST_UNPACKED:
                raise InputError(Problem(self.path, f"{size / 1e6:.0f} MB", ALLOWED, SMALLER))
            self._book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        except InputError:
            raise
        except Exception as error:  # a damaged part of a workbook raises whatever it meets
            raise self._unreadable(error) from None
        shown = [each for each in self._book.worksheets if each.sheet_state == "visible"]
        self.sheets = [each.title for each in shown]
        if not self.sheets:
            raise InputError(Problem(self.path, "has no sheet with cells", "a sheet with a table"))

    def __enter__(self) -> Workbook:
        return self

    def __exit__(self, *_: object) -> None:
        self._book.close()

    def rows(self, sheet: str, most: int = MOST_ROWS) -> list[Row]:
        """The first rows of a sheet that are not blank, each with its number, of equal length."""
        found: list[Row] = []
        worksheet = self._book[sheet]
        worksheet.reset_dimensions()  # what a workbook says of its size may be wrong
        held = 0
        try:
            for number, values in enumerate(worksheet.iter_rows(values_only=True), 1):
                held += len(values)
                refuse_too_much(self.path, len(found), 0, held // 3)  # blank ones, by their places
                cells = [_cell(value) for value in values]
                while cells and cells[-1] is None:
                    cells.pop()
                refuse_too_much(self.path, number * (number > _LAST_ROW), len(cells), 0)
                if cells and len(found) < most:
                    found.append((number, cells))
                elif len(found) >= most:
                    break
        except InputError:
            raise
        except Exception as error:
            raise self._unreadable(error) from None
        width = max((len(cells) for _, cells in found), default=0)
        refuse_too_much(self.path, len(found), width, width * len(found))
        return [(line, cells + [None] * (width - len(cells))) for line, cells in found]

    def _unreadable(self, error: Exception) -> InputError:
        reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        with open(self.path, "rb") as file:
            if file.read(4) == b"\xd0\xcf\x11\xe0":
                reason = "it is locked by a password, or of the old Excel format under a new name"
        what = f"cannot be read as a workbook: {reason}"
        return InputError(Problem(self.path, what, "an .xlsx file", "save it as .xlsx or CSV"))


def _cell(value: object) -> object:
    if isinstance(value, str):
        return value.strip() or None
    return str(value).upper() if isinstance(value, bool) else value


def _of_parquet(path: Path) -> RawTable:
    """The rows of a Parquet file, whose footer is looked at before it is unpacked."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    where = str(path)
    try:
        with pq.ParquetFile(path) as file:
            schema, footer = file.schema_arrow, file.metadata
        rows, width = footer.num_rows, footer.num_columns
        refuse_too_much(where, rows, width, rows * width)
        groups = footer.num_row_groups
        sizes = [footer.row_group(n).total_byte_size for n in range(min(groups, MOST_ROWS))]
        if groups > MOST_ROWS // 100 or sum(sizes) > MOST_BYTES:
            what = f"{sum(sizes) / 1e6:.0f} MB in {groups} groups of rows"
            raise InputError(Problem(where, what, ALLOWED, SMALLER))
        if doubled := sorted({n for n in schema.names if schema.names.count(n) > 1}):
            raise InputError(Problem(where, f"column names given twice: {', '.join(doubled)}"))
        flat = [field.name for field in schema if not pa.types.is_nested(field.type)]
        # The same text in a million rows is held once.
        texts = [n for n in flat if pa.types.is_string(schema.field(n).type)
                 or pa.types.is_large_string(schema.field(n).type)]  # fmt: skip
        with pq.ParquetFile(path, read_dictionary=texts) as file:
            table = file.read(columns=flat)
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(Problem(where, f"not a Parquet file: {reason}")) from None
    if not rows:
        raise InputError(Problem(where, "the table has no rows", "at least one row"))
    columns = {
        field.name: _cells(table.column(field.name), where)
        if field.name in flat
        else [f"<{field.type}>"] * rows  # one cell of a list may hold a million values
        for field in schema
    }
    return RawTable.of(where, columns, np.arange(1, rows + 1))


def _cells(column, where: str) -> list:
    """Values of a Parquet column; the column's type as text where Python has no such value.

    Raises InputError where a few long texts, repeated, are more than could be worked through.
    """
    import pyarrow as pa

    try:
        if pa.types.is_dictionary(column.type):
            cells: list = []
            for chunk in column.chunks:
                words = chunk.dictionary.to_pylist()
                places = chunk.indices.to_pylist()
                size = sum(len(str(words[place])) for place in places if place is not None)
                if size > MOST_BYTES:
                    what = f"texts of {size / 1e6:.0f} MB in one column"
                    raise InputError(Problem(where, what, ALLOWED, SMALLER))
                cells += [None if place is None else words[place] for place in places]
            return cells
        return column.to_pylist()
    except (pa.ArrowException, ArithmeticError, LookupError, ValueError):
        # A date outside the calendar, text that is not UTF-8.
        return [f"<{column.type}>"] * len(column)
