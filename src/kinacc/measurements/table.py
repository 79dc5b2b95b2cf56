"""A file of rows and named columns, with the line every row came from; its cells as numbers."""

from __future__ import annotations

import datetime
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kinacc.errors import Problem
from kinacc.measurements.row_names import RowNames

# What instruments, controllers and spreadsheets write where there is nothing.
_NOTHING_TEXT = """
nan|na|n/a|null|none|#n/a|n.a.|#nv|#value!|#wert!|#div/0!|#null!|#ref!|k.a.|k. a.|n.d.|-nan|?
nan(ind)|-nan(ind)|no reading|no data|nodata|no value|invalid|missing|lost|beam broken|no signal
fehlt|ungültig|keine messung|kein wert|nicht gemessen|non mesuré|no medido|non misurato|欠測
"""
_NOTHING = frozenset(word for line in _NOTHING_TEXT.split("\n") for word in line.split("|"))
_DASHES = frozenset("-–—*./")  # --, ---.---, ****
_DIGITS = tuple("123456789")
_LONGEST_NOTHING = max(map(len, _NOTHING))
_LARGEST_CELL = 1e75  # its fourth power is still a float
_SHOWN = 5  # rows named per problem; the rest is counted
_LARGEST = 1e12  # beyond all lengths and angles
_BLANKS = re.compile(r"[\u00a0\u2007\u2009\u202f]")  # blanks that keep a number on one line
_DATE = re.compile(r"\d{1,4}[./-]\d{1,2}[./-]\d{1,4}(?:[ T].*)?|\d{1,2}[.-]? ?[^\W\d_]{3,9}\.?")

# What is held at once; calibrations are made from some hundred to some ten thousand rows.
MOST_ROWS, MOST_COLUMNS, MOST_CELLS = 1_000_000, 10_000, 10_000_000
MOST_BYTES = 500_000_000
ALLOWED = (
    f"at most {MOST_ROWS} rows, {MOST_COLUMNS} columns, {MOST_CELLS} cells and "
    f"{MOST_BYTES // 1_000_000} MB unpacked"
)
SMALLER = "give the rows and columns of the measurements alone"


@dataclass(frozen=True)
class RawTable:
    """Columns of a measurement file as read: text cells of a CSV, or values of a Parquet file.

    ``path`` names the file, with the sheet where it has several. ``line`` (n,) is the line in the
    file a row stands on (CSV), its row in the sheet (Excel) or its row number from 1 (Parquet).
    ``under`` are the cells of the line left out under the names, such as a line of units.
    ``notes`` say what of the file is no row, ``not_rows`` are the lines of that. ``letters`` are
    the letters of the columns of a sheet. ``pose_name`` are the file's names of poses by line, as
    far as they are known. Where joints stand in another file, ``points_file`` is the one of the
    lines, ``key`` its column that says which joints are those of a point.
    """

    path: str
    columns: dict[str, list]
    line: np.ndarray
    decimal: str
    under: tuple[str, ...] = ()
    thousands: str | None = None
    notes: tuple[str, ...] = ()
    not_rows: tuple[int, ...] = ()
    letters: Mapping[str, str] = field(default_factory=dict)
    pose_name: Mapping[int, str] = field(default_factory=dict)
    points_file: str = ""
    key: str | None = None

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

    @property
    def row_names(self) -> RowNames:
        """What its rows are called; a sheet has rows and no lines."""
        word = "row" if self.letters else "line"
        return RowNames(self.pose_name, self.points_file, word)

    def rows_in_words(self, rows: np.ndarray) -> str:
        """Lines of the rows at indices ``rows``, the first few by number."""
        return self.lines_in_words(self.line[rows])

    def lines_in_words(self, lines: Sequence) -> str:
        """Lines, the first few by number; rows where the file is a sheet."""
        return self.row_names.few(lines, _SHOWN)

    def with_pose_names(self, column: str) -> RawTable:
        """The table, with the names of poses in ``column``; mere numbers are none."""
        cells = self.columns[column]
        words = ~np.isfinite(_converted(cells, self.decimal, self.thousands))
        named = {
            int(self.line[row]): str(cells[row]).strip()
            for row in np.flatnonzero(words)
            if not _is_gap(cells[row])
        }
        return replace(self, pose_name=named)

    def column_in_words(self, name: str) -> str:
        """A column as the person sees it: its name, and its letter in a sheet."""
        letter = self.letters.get(name)
        return f"{name} ({letter})" if letter else name


def numbers(table: RawTable, name: str, problems: list[Problem], *, gaps: bool = False):
    """Column ``name`` as floats (n,); cells that are no finite number are added to ``problems``.

    With ``gaps`` an empty cell is allowed and becomes NaN.
    """
    cells = table.columns[name]
    values = _converted(cells, table.decimal, table.thousands)
    bad = np.flatnonzero(~(np.abs(values) < _LARGEST_CELL))
    if gaps:
        bad = np.array([row for row in bad if not _is_gap(cells[row])], dtype=int)
    if bad.size:
        problems.append(_no_numbers(table, name, bad))
    return values


def _no_numbers(table: RawTable, name: str, bad: np.ndarray) -> Problem:
    cells = [table.columns[name][row] for row in bad]
    where = f"{table.path}: column {table.column_in_words(name)}, {table.rows_in_words(bad)}"
    shown = ", ".join(_shortened(_as_seen(cell)) for cell in cells[:_SHOWN])
    other = "," if table.decimal == "." else "."
    fix = "correct the cells"
    if all(map(_is_date, cells)):
        what = f"a date where a number is expected: {shown}"
        fix = "a spreadsheet may have made it of a number: export the file anew, columns as text"
        return Problem(where, what, f"numbers with decimal mark {table.decimal!r}", fix)
    if np.isfinite(_converted(cells, other, None)).any():
        fix = f"correct the cells, or set measurements.file.decimal to {other!r}"
        fix += f" or measurements.file.thousands to {other!r}" if table.thousands is None else ""
    elif all(map(_is_gap, cells)):
        fix = "fill the cells in"
    return Problem(
        where,
        f"not a finite number: {shown}",
        f"numbers with decimal mark {table.decimal!r}",
        fix,
    )


def _as_seen(cell: object) -> str:
    return str(cell) if isinstance(cell, (datetime.date, datetime.time)) else repr(cell)


def _is_date(cell: object) -> bool:
    if isinstance(cell, str):
        return len(cell) < 40 and bool(_DATE.fullmatch(cell.strip()))
    return isinstance(cell, (datetime.date, datetime.time))


def numbers_of(text: str) -> np.ndarray:
    """Numbers (n,) of a text such as "1, 2.5,-3" or "1 2.5 -3".

    None where a word is no number, or one beyond all lengths and angles.
    """
    try:
        # Of other alphabets' digits, and of 1_000, Python would make numbers.
        plain = text if text.isascii() and "_" not in text else "none"
        values = np.array([float(word) for word in plain.replace(",", " ").split()])
    except ValueError:
        return np.zeros(0)
    return values if (np.abs(values) <= _LARGEST).all() else np.zeros(0)


def _shortened(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


def _converted(cells: list, decimal: str, thousands: str | None) -> np.ndarray:
    """Cells as floats (n,), NaN where one is none."""
    try:
        text = "\n".join(cells) if thousands is None else None
    except TypeError:
        text = None  # values of a Parquet file or of a sheet
    try:
        if text is not None and "_" not in text and not (decimal == "," and "." in text):
            words = text.replace("\u2212", "-").replace(decimal, ".").split("\n")
            if len(words) == len(cells):
                return np.array([float(word) for word in words])
        return np.array([_number(cell, decimal, thousands) for cell in cells])
    except (OverflowError, TypeError, ValueError):
        return np.array([_number_or_nan(cell, decimal, thousands) for cell in cells])


def _number(cell: object, decimal: str, thousands: str | None) -> float:
    if not isinstance(cell, str):
        return float(cell)
    if "_" in cell:  # which Python takes
        raise ValueError(cell)
    cell = cell.replace("\u2212", "-")
    if thousands is not None:
        blank = thousands == " "
        cell = _BLANKS.sub(" ", cell.strip()) if blank else cell.replace("\u2019", "'")
        if thousands in cell:
            whole = rf"[+-]?\d{{1,3}}(?:{re.escape(thousands)}\d{{3}})+(?:{re.escape(decimal)}\d*)?"
            if not re.fullmatch(whole, cell.strip()):
                raise ValueError(cell)
            cell = cell.replace(thousands, "")
    if decimal != ".":
        # A point would be a thousands mark there: refuse it instead of guessing.
        if "." in cell:
            raise ValueError(cell)
        cell = cell.replace(decimal, ".")
    return float(cell)


def _number_or_nan(cell: object, decimal: str, thousands: str | None) -> float:
    try:
        return _number(cell, decimal, thousands)
    except (OverflowError, TypeError, ValueError):
        return float("nan")


def _is_gap(cell: object) -> bool:
    """Empty, or not a number in one of the ways programs and people write it."""
    if isinstance(cell, str):
        if cell[:1] in _DIGITS:
            return False
        word = cell.strip()
        if len(word) > _LONGEST_NOTHING:
            return False
        return word.lower() in _NOTHING or _DASHES.issuperset(word)
    return cell is None or cell != cell


def doubled_in(names: Sequence[str]) -> str:
    """Names that are there more than once, in words."""
    return ", ".join(sorted(name for name, count in Counter(names).items() if count > 1))
