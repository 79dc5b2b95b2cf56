"""A file of rows and named columns, as text with the line every row came from."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem

_NOTHING = ("", "nan", "na", "n/a", "null", "none", "#n/a")
_SHOWN = 5  # rows named per problem; the rest is counted


@dataclass(frozen=True)
class RawTable:
    """Columns of a measurement file as read: text cells of a CSV, or values of a Parquet file.

    ``line`` (n,) is the line in the file a row stands on (CSV) or its row number from 1 (Parquet).
    ``under`` are the cells of the line left out under the names, such as a line of units.
    """

    path: str
    columns: dict[str, list]
    line: np.ndarray
    decimal: str = "."
    under: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.line)

    @staticmethod
    def is_gap(cell: object) -> bool:
        """Whether a cell is empty."""
        return _is_gap(cell)

    def gaps(self, name: str) -> np.ndarray:
        """True (n,) where the cell of column ``name`` is empty."""
        return np.array([_is_gap(cell) for cell in self.columns[name]], dtype=bool)

    def rows_in_words(self, rows: np.ndarray) -> str:
        """Lines of the rows at indices ``rows``, the first few by number."""
        lines = [str(self.line[row]) for row in rows[:_SHOWN]]
        more = f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
        return f"line{'s' if len(rows) > 1 else ''} {', '.join(lines)}{more}"


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
    return _csv(path, delimiter, decimal, skip)


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
        shown = ", ".join(repr(cells[row]) for row in bad[:_SHOWN])
        problems.append(
            Problem(
                f"{table.path}: column {name}, {table.rows_in_words(bad)}",
                f"not a finite number: {shown}",
                f"numbers with decimal mark {table.decimal!r}",
                "correct the cells or set measurements.file.decimal",
            )
        )
    return values


def _converted(cells: list, decimal: str) -> np.ndarray:
    try:
        return np.array([_number(cell, decimal) for cell in cells])
    except (TypeError, ValueError):
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
    except (TypeError, ValueError):
        return float("nan")


def _is_gap(cell: object) -> bool:
    """Empty, or not a number in one of the ways numerical programs write it."""
    if isinstance(cell, str):
        return cell.strip().lower() in _NOTHING
    return cell is None or cell != cell


def _csv(path: Path, delimiter: str, decimal: str, skip: tuple[int, int]) -> RawTable:
    above, under = skip
    with open(path, newline="", encoding="utf-8-sig", errors="replace") as stream:
        reader = csv.reader(stream, delimiter=delimiter)
        header: list[str] = []
        left_out: list[str] = []
        rows, lines = [], []
        for cells in reader:
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
    if problems:
        raise InputError(problems, f"{path} cannot be read")
    columns = {
        name: list(cells) for name, cells in zip(header, zip(*rows, strict=True), strict=True)
    }
    return RawTable(str(path), columns, np.array(lines), decimal, tuple(left_out))


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
    doubled = sorted({name for name in header if header.count(name) > 1})
    if doubled:
        found.append(Problem(f"{path}: line 1", f"column names given twice: {', '.join(doubled)}"))
    return found


def _parquet(path: Path) -> RawTable:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (pa.ArrowInvalid, OSError) as error:
        raise InputError(Problem(str(path), f"not a Parquet file: {error}")) from None
    if not table.num_rows:
        raise InputError(Problem(str(path), "the table has no rows", "at least one row"))
    columns = {name: table.column(name).to_pylist() for name in table.column_names}
    return RawTable(str(path), columns, np.arange(1, table.num_rows + 1))
