"""A file of rows and named columns, as text with the line every row came from; text as numbers."""

from __future__ import annotations

import csv
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem, first_few, refuse

_NOTHING = ("", "nan", "na", "n/a", "null", "none", "#n/a")
_LONGEST_NOTHING = max(map(len, _NOTHING))
_LARGEST = 1e12  # beyond all lengths and angles
_SHOWN = 5  # rows named per problem; the rest is counted

# What is held at once; calibrations are made from some hundred to some ten thousand rows.
_MOST_ROWS, _MOST_COLUMNS, _MOST_CELLS = 1_000_000, 10_000, 10_000_000
_MOST_BYTES = 500_000_000
_ALLOWED = (
    f"at most {_MOST_ROWS} rows, {_MOST_COLUMNS} columns, {_MOST_CELLS} cells and "
    f"{_MOST_BYTES // 1_000_000} MB unpacked"
)
_SMALLER = "give the rows and columns of the measurements alone"


@dataclass(frozen=True)
class RawTable:
    """Columns of a measurement file as read: text cells of a CSV, or values of a Parquet file.

    ``line`` (n,) is the line in the file a row stands on (CSV) or its row number from 1 (Parquet).
    ``under`` are the cells of the line left out under the names, such as a line of units.
    ``notes`` say what of the file was left out.
    """

    path: str
    columns: dict[str, list]
    line: np.ndarray
    decimal: str = "."
    under: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.line)

    @staticmethod
    def is_gap(cell: object) -> bool:
        """Whether a cell is empty."""
        return _is_gap(cell)

    def gaps(self, name: str) -> np.ndarray:
        """True (n,) where the cell of column ``name`` is empty."""
        return np.array([_is_gap(cell) for cell in self.columns[name]], dtype=bool)

    def select(self, rows: np.ndarray) -> RawTable:
        """The table of the rows at indices ``rows``."""
        columns = {name: [cells[row] for row in rows] for name, cells in self.columns.items()}
        return replace(self, columns=columns, line=self.line[rows])

    def rows_in_words(self, rows: np.ndarray) -> str:
        """Lines of the rows at indices ``rows``, the first few by number."""
        return f"line{'s' if len(rows) > 1 else ''} {first_few(self.line[rows], _SHOWN)}"


def load(
    path: str | Path,
    delimiter: str,
    decimal: str,
    source: str | None = None,
    skip: tuple[int, int] = (0, 0),
) -> RawTable:
    """Read a CSV or Parquet file. Raises InputError where it is missing, empty or ragged.

    ``skip``: lines of a CSV that are left out above and under the line of column names.
    """
    path = Path(path)
    if not path.is_file():
        origin = f"the data comes from: {source}" if source else "check measurements.file.path"
        raise InputError(Problem(str(path), "no such file", "a CSV or Parquet file", origin))
    if path.suffix.lower() in (".parquet", ".pq"):
        return _parquet(path)
    from kinacc.measurements import robot_programs

    program = robot_programs.read(path)
    return program or robot_programs.expanded(_csv(path, delimiter, decimal, skip))


def numbers(table: RawTable, name: str, problems: list[Problem], *, gaps: bool = False):
    """Column ``name`` as floats (n,); cells that are no finite number are added to ``problems``.

    With ``gaps`` an empty cell is allowed and becomes NaN.
    """
    cells = table.columns[name]
    values = _converted(cells, table.decimal)
    bad = np.flatnonzero(~np.isfinite(values))
    if gaps:
        bad = np.array([row for row in bad if not _is_gap(cells[row])], dtype=int)
    if bad.size:
        shown = ", ".join(_shortened(repr(cells[row])) for row in bad[:_SHOWN])
        problems.append(
            Problem(
                f"{table.path}: column {name}, {table.rows_in_words(bad)}",
                f"not a finite number: {shown}",
                f"numbers with decimal mark {table.decimal!r}",
                "correct the cells or set measurements.file.decimal",
            )
        )
    return values


def numbers_of(text: str) -> np.ndarray:
    """Numbers (n,) of a text such as "1, 2.5,-3" or "1 2.5 -3".

    None where a word is no number, or one beyond all lengths and angles.
    """
    try:
        values = np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError:
        return np.zeros(0)
    return values if (np.abs(values) <= _LARGEST).all() else np.zeros(0)


def _shortened(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


def _converted(cells: list, decimal: str) -> np.ndarray:
    try:
        return np.array([_number(cell, decimal) for cell in cells])
    except (OverflowError, TypeError, ValueError):
        return np.array([_number_or_nan(cell, decimal) for cell in cells])


def _number(cell: object, decimal: str) -> float:
    if isinstance(cell, str) and decimal != ".":
        # A point would be a thousands mark there: refuse it instead of guessing.
        if "." in cell:
            raise ValueError(cell)
        cell = cell.replace(decimal, ".")
    return float(cell)


def _number_or_nan(cell: object, decimal: str) -> float:
    try:
        return _number(cell, decimal)
    except (OverflowError, TypeError, ValueError):
        return float("nan")


def _is_gap(cell: object) -> bool:
    """Empty, or not a number in one of the ways numerical programs write it."""
    if isinstance(cell, str):
        word = cell.strip()
        return len(word) <= _LONGEST_NOTHING and word.lower() in _NOTHING
    return cell is None or cell != cell


def _csv(path: Path, delimiter: str, decimal: str, skip: tuple[int, int]) -> RawTable:
    above, under = skip
    if path.stat().st_size > _MOST_BYTES:
        what = f"{path.stat().st_size / 1e6:.0f} MB"
        raise InputError(Problem(str(path), what, _ALLOWED, _SMALLER))
    with open(path, newline="", encoding="utf-8-sig", errors="replace") as stream:
        reader = csv.reader(stream, delimiter=delimiter)
        header: list[str] = []
        left_out: list[str] = []
        rows, lines, count = [], [], 0
        for cells in _lines(reader, path):
            count += len(cells)
            if len(rows) >= _MOST_ROWS or count > _MOST_CELLS or len(cells) > _MOST_COLUMNS:
                what = f"more than {len(rows)} rows of {len(header) or len(cells)} columns"
                raise InputError(Problem(str(path), what, _ALLOWED, _SMALLER))
            if reader.line_num <= above or not any(cell.strip() for cell in cells):
                continue
            if not header:
                header = [cell.strip() for cell in cells]
            elif under > 0:
                under -= 1
                left_out = cells
            else:
                rows.append(cells)
                lines.append(reader.line_num)
    problems = _header_problems(path, header, rows, delimiter)
    ragged = [i for i, cells in enumerate(rows) if len(cells) != len(header)]
    if ragged and not problems:
        named = RawTable(str(path), {}, np.array(lines)).rows_in_words(np.array(ragged))
        problems.append(
            Problem(
                f"{path}: {named}",
                f"{len(rows[ragged[0]])} cells under {len(header)} column names",
                f"{len(header)} cells in every row",
                "check the delimiter and the decimal mark",
            )
        )
    refuse(problems, f"{path} cannot be read")
    columns = {
        name: list(cells) for name, cells in zip(header, zip(*rows, strict=True), strict=True)
    }
    return RawTable(str(path), columns, np.array(lines), decimal, tuple(left_out))


def _lines(reader, path: Path):
    """Rows of a csv reader. Raises InputError where a cell has no end."""
    try:
        yield from reader
    except csv.Error as error:
        where = f"{path}: line {reader.line_num}"
        allowed = "cells of at most 131072 characters, each quotation mark with its second"
        raise InputError(Problem(where, f"cannot be read: {error}", allowed)) from None


def _doubled(names: list[str]) -> str:
    """Names that are there more than once, in words."""
    return ", ".join(sorted(name for name, count in Counter(names).items() if count > 1))


def _header_problems(path: Path, header: list[str], rows: list, delimiter: str) -> list[Problem]:
    if not header:
        return [Problem(str(path), "the file is empty", "a line of column names, then rows")]
    found = []
    if not rows:
        found.append(Problem(str(path), "no rows under the column names", "at least one row"))
    if len(header) == 1:
        others = [mark for mark in (",", ";", "\t") if mark != delimiter and mark in header[0]]
        hint = f"set measurements.file.delimiter to {others[0]!r}" if others else ""
        found.append(
            Problem(f"{path}: line 1", f"only one column, {header[0][:60]!r}", "several", hint)
        )
    doubled = _doubled(header)
    if doubled:
        found.append(Problem(f"{path}: line 1", f"column names given twice: {doubled}"))
    return found


def _parquet(path: Path) -> RawTable:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            schema, problem = file.schema_arrow, _too_large(str(path), file.metadata)
        doubled = _doubled(schema.names)
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
    return RawTable(str(path), columns, np.arange(1, rows + 1))


def _is_text(kind) -> bool:
    import pyarrow as pa

    return pa.types.is_string(kind) or pa.types.is_large_string(kind)


def _too_large(where: str, footer) -> Problem | None:
    """What the footer of a Parquet file says of its size, before anything is unpacked."""
    rows, width, groups = footer.num_rows, footer.num_columns, footer.num_row_groups
    what = ""
    if rows > _MOST_ROWS or width > _MOST_COLUMNS or rows * width > _MOST_CELLS:
        what = f"{rows} rows of {width} columns"
    elif groups > _MOST_ROWS // 100:
        what = f"{groups} groups of rows"
    else:
        size = sum(footer.row_group(number).total_byte_size for number in range(groups))
        what = f"{size / 1e6:.0f} MB" if size > _MOST_BYTES else ""
    return Problem(where, what, _ALLOWED, _SMALLER) if what else None


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
            if size > _MOST_BYTES:
                what = f"texts of {size / 1e6:.0f} MB in one column"
                raise InputError(Problem(where, what, _ALLOWED, _SMALLER))
            cells += [None if place is None else words[place] for place in places]
        return cells
    except (pa.ArrowException, ArithmeticError, LookupError, ValueError):
        # A date outside the calendar, text that is not UTF-8.
        return [f"<{column.type}>"] * len(column)
