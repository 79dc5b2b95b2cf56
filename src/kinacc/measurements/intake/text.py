"""How a file of rows is written: what parts its columns, its decimal mark, where its names are."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from kinacc.errors import InputError, Problem
from kinacc.measurements import robot_programs
from kinacc.measurements.table import RawTable, load

DELIMITERS = (";", "\t", ",", " ")
_LINES, _CHARACTERS = 200, 1_000_000  # looked at
_POINT = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(\d+(,\d*)?|,\d+)([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Written:
    """How a file is written, as ``measurements.file`` has it.

    ``units`` are the cells of a line of units under the names, empty where there is none.
    """

    delimiter: str = ","
    decimal: str = "."
    skip_lines: int = 0
    skip_under_names: int = 0
    units: tuple[str, ...] = ()

    def load(self, path: str | Path) -> RawTable:
        """The file so read."""
        skip = (self.skip_lines, self.skip_under_names)
        return load(path, self.delimiter, self.decimal, skip=skip)


def look(path: str | Path) -> Written:
    """How the file at ``path`` is written. Raises InputError where it is no table of numbers."""
    path = Path(path)
    if not path.is_file():
        raise InputError(Problem(str(path), "no such file", "a CSV or Parquet file"))
    if path.suffix.lower() in (".parquet", ".pq"):
        return Written()
    if robot_programs.read(path) is not None:
        return Written()
    with open(path, encoding="utf-8-sig", errors="replace") as stream:
        head = stream.read(_CHARACTERS)
    lines = head.split("\n")
    if lines and (len(head) == _CHARACTERS or not lines[-1]):
        lines = lines[:-1] or lines  # the last one may have been cut
    lines = lines[:_LINES]
    best = max(_score(lines, mark, decimal) for mark in DELIMITERS for decimal in ".,")
    numbers, columns, _, mark, decimal = best
    if not numbers or columns < 2:
        what = "no line of column names above rows of numbers was found"
        raise InputError(Problem(str(path), what, "columns parted by ; , tab or space"))
    head = _head(lines, mark, decimal)
    if head is None:
        what = "the columns have no names"
        fix = "write a line of names above the numbers, such as q1_deg,..,x_mm,y_mm,z_mm"
        raise InputError(Problem(str(path), what, "one line of names", fix))
    above, under = head
    units = tuple(_cells(lines[above + 1], mark)) if under else ()
    return Written(mark, decimal, above, under, units)


def _score(lines: list[str], mark: str, decimal: str) -> tuple:
    """Cells that are numbers in rows of the commonest width, that width, and tie-breakers."""
    if mark == decimal:
        return (0, 0, 0, mark, decimal)
    rows = [_cells(line, mark) for line in lines if line.strip()]
    widths = [len(row) for row in rows]
    if not widths:
        return (0, 0, 0, mark, decimal)
    width = max(set(widths), key=widths.count)
    good = [row for row in rows if len(row) == width]
    # A number that takes both marks (12) tells nothing: the point is the usual one.
    return (
        sum(_is_number(cell, decimal) for row in good for cell in row) if width > 1 else 0,
        width,
        DELIMITERS[::-1].index(mark) + (decimal == "."),
        mark,
        decimal,
    )


def _head(lines: list[str], mark: str, decimal: str) -> tuple[int, int] | None:
    """Lines above the line of names, and lines between it and the first row of numbers."""
    numeric = [_mostly_numbers(_cells(line, mark), decimal) for line in lines]
    if True not in numeric:
        return None
    first = numeric.index(True)
    width = len(_cells(lines[first], mark))
    texts = [i for i in range(first) if len(_cells(lines[i], mark)) == width and lines[i].strip()]
    if not texts:
        return None
    # The names come first; a line of units may follow.
    names = texts[0] if len(texts) == 1 or texts[0] == first - 2 else texts[-1]
    return names, first - 1 - names


def _mostly_numbers(cells: list[str], decimal: str) -> bool:
    filled = [cell for cell in cells if cell]
    return len(filled) > 1 and 2 * sum(_is_number(cell, decimal) for cell in filled) > len(filled)


def _cells(line: str, mark: str) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(mark)]


def _is_number(cell: str, decimal: str) -> bool:
    return bool((_POINT if decimal == "." else _COMMA).fullmatch(cell))
