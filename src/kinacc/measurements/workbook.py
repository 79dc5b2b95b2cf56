"""An Excel workbook as a table: the rows of one of its sheets, numbers as numbers."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

from kinacc.errors import InputError, Problem
from kinacc.measurements.grid import Row, tabled
from kinacc.measurements.table import (
    ALLOWED,
    MOST_CELLS,
    MOST_COLUMNS,
    MOST_ROWS,
    SMALLER,
    RawTable,
)
from kinacc.measurements.written import Written

_LAST_ROW = 1_048_576  # that a workbook can have
_MOST_BYTES = 150_000_000  # unpacked; a sheet of a million cells has some 40 MB


def load(path: Path, written: Written) -> RawTable:
    """The rows of the sheet, its first where none is named."""
    with Workbook(path) as book:
        sheet = book.sheets[0] if written.sheet is None else written.sheet
        if sheet not in book.sheets:
            where, what = f"{path}: measurements.file.sheet", f"there is no sheet {sheet!r}"
            raise InputError(Problem(where, what, ", ".join(book.sheets)))
        rows = list(book.rows(sheet))
    width = max((len(cells) for _, cells in rows), default=0)
    padded = ((line, cells + [None] * (width - len(cells))) for line, cells in rows)
    return tabled(f"{path}, sheet {sheet!r}", padded, written, letters_of(width))


def letters_of(width: int) -> list[str]:
    """Letters of the first columns of a sheet: A, B, .. Z, AA."""
    from openpyxl.utils import get_column_letter

    return [get_column_letter(number) for number in range(1, width + 1)]


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
            if size > _MOST_BYTES:
                raise InputError(Problem(self.path, f"{size / 1e6:.0f} MB", ALLOWED, SMALLER))
            self._book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        except InputError:
            raise
        except Exception as error:  # a damaged part of a workbook raises whatever it meets
            raise InputError(_unreadable(self.path, error)) from None
        self.sheets = [
            each.title for each in self._book.worksheets if each.sheet_state == "visible"
        ]
        if not self.sheets:
            raise InputError(Problem(self.path, "has no sheet with cells", "a sheet with a table"))

    def __enter__(self) -> Workbook:
        return self

    def __exit__(self, *_: object) -> None:
        self._book.close()

    def rows(self, sheet: str, most: int = MOST_ROWS) -> Iterator[Row]:
        """Rows of a sheet that are not blank, each with its number, blank cells at its end cut."""
        count = seen = held = 0
        worksheet = self._book[sheet]
        worksheet.reset_dimensions()  # what a workbook says of its size may be wrong
        try:
            for number, values in enumerate(worksheet.iter_rows(values_only=True), 1):
                held += len(values)
                if number > _LAST_ROW or held > 3 * MOST_CELLS:  # blank ones, by their places
                    what = f"more than {number - 1} rows in sheet {sheet!r}"
                    raise InputError(Problem(self.path, what, ALLOWED, SMALLER))
                if values.count(None) == len(values):
                    continue
                cells = [_cell(value) for value in values]
                while cells and cells[-1] is None:
                    cells.pop()
                if not cells:
                    continue
                count, seen = count + len(cells), seen + 1
                if seen > MOST_ROWS or count > MOST_CELLS or len(cells) > MOST_COLUMNS:
                    what = f"more than {seen - 1} rows in sheet {sheet!r}"
                    raise InputError(Problem(self.path, what, ALLOWED, SMALLER))
                if seen > most:
                    return
                yield number, cells
        except InputError:
            raise
        except Exception as error:
            raise InputError(_unreadable(self.path, error)) from None


def _cell(value: object) -> object:
    if isinstance(value, str):
        return value.strip() or None
    return str(value).upper() if isinstance(value, bool) else value


def _unreadable(path: str, error: Exception) -> Problem:
    reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
    with open(path, "rb") as file:
        start = file.read(8)
    if start.startswith(b"\xd0\xcf\x11\xe0"):
        reason = "it is locked by a password, or of the old Excel format under a new name"
    return Problem(
        path, f"cannot be read as a workbook: {reason}", "an .xlsx file", "save it as .xlsx or CSV"
    )
