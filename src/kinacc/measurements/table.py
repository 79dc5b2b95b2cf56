"""A file of rows and named columns, with the line every row came from; its cells as numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from kinacc.errors import Problem
from kinacc.measurements.column_names import WORDS
from kinacc.measurements.row_names import RowNames

# What instruments, controllers and spreadsheets write where there is nothing.
_NOTHING = frozenset(WORDS["nothing"])
_DASHES = frozenset("-–—*./")  # --, ---.---, ****
_LARGEST_CELL = 1e75  # its fourth power is still a float
_LARGEST = 1e12  # beyond all lengths and angles
_SHOWN = 5  # rows named per problem; the rest is counted
_BLANKS = re.compile(r"[\u00a0\u2007\u2009\u202f]")  # blanks that keep a number on one line


@dataclass(frozen=True)
class RawTable:
    """Cells of a measured file as read: text of a CSV, or values of a sheet or Parquet file.

    ``path`` names the file, with the sheet where it has several. ``line`` (n,) is the line of the
    file a row stands on, its row in a sheet or its number from 1 in a Parquet file. ``units`` are
    those stated under the names or behind the numbers, by column. ``notes`` name what of the file
    is no row, ``row_names`` what its rows are called. ``key``: where joints stand in another file,
    the column by which they belong to a point.
    """

    path: str
    columns: pd.DataFrame
    line: np.ndarray
    decimal: str = "."
    thousands: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    row_names: RowNames = field(default_factory=RowNames)
    key: str | None = None

    def __len__(self) -> int:
        return len(self.line)

    @staticmethod
    def is_gap(cell: object) -> bool:
        """Whether a cell is empty, or holds one of the words that programs and people write."""
        if isinstance(cell, str):
            word = cell.strip().lower()
            return word in _NOTHING or _DASHES.issuperset(word)
        return cell is None or cell is pd.NaT or cell != cell

    def gaps(self, name: str) -> np.ndarray:
        """True (n,) where the cell of column ``name`` is empty."""
        empty = np.isnan(self.values(name))
        empty[empty] = [self.is_gap(cell) for cell in self.columns[name][empty]]
        return empty

    def texts(self, name: str) -> list[str]:
        """Cells of a column as texts."""
        return [str(cell).strip() for cell in self.columns[name]]

    def values(self, name: str) -> np.ndarray:
        """Numbers (n,) of a column, NaN where a cell is none."""
        return _converted(self.columns[name].tolist(), self.decimal, self.thousands)

    def stacked(self, names: Iterable[str]) -> np.ndarray:
        """Numbers (n, k) of k columns, NaN where a cell is none."""
        return np.stack([self.values(name) for name in names], axis=1)

    def select(self, rows: np.ndarray) -> RawTable:
        """The table of some rows, by their indices or a mask."""
        columns = self.columns.iloc[rows].reset_index(drop=True)
        return replace(self, columns=columns, line=self.line[rows])

    def rows_in_words(self, rows: np.ndarray) -> str:
        """Lines of rows, by their indices or a mask."""
        return self.row_names.spans(self.line[rows])

    def with_pose_names(self, column: str) -> RawTable:
        """The table, with the names of poses in ``column``; mere numbers are none."""
        cells, values = self.columns[column], self.values(column)
        parts = zip(self.line.tolist(), cells, values, strict=True)
        named = {n: str(c).strip() for n, c, v in parts if v != v and not self.is_gap(c)}
        return replace(self, row_names=replace(self.row_names, pose=named))

    def where(self, column: str, rows: np.ndarray | None = None) -> str:
        """The place of a column, or of several, at rows (indices or a mask), for a problem."""
        lines = "" if rows is None else f", {self.rows_in_words(rows)}"
        return f"{self.path}: column{'s' * (', ' in column)} {column}{lines}"


def frame(columns: Mapping[str, Iterable[Any]]) -> pd.DataFrame:
    """Columns of cells as they are."""
    return pd.DataFrame({n: pd.Series(list(c), dtype=object) for n, c in columns.items()})


def numbers(
    table: RawTable, name: str, problems: list[Problem], *, gaps: bool = False
) -> np.ndarray:
    """Column ``name`` as floats (n,); cells that are no finite number are added to ``problems``.

    With ``gaps`` an empty cell is allowed and becomes NaN.
    """
    values = table.values(name)
    bad = ~(np.abs(values) < _LARGEST_CELL)
    if gaps and bad.any():
        bad &= ~table.gaps(name)
    if bad.any():
        cells = table.columns[name][bad].tolist()
        shown = ", ".join(repr(cell)[:60] for cell in cells[:_SHOWN])
        where, allowed = table.where(name, bad), f"numbers with decimal mark {table.decimal!r}"
        fix = "correct the cells, or measurements.file.decimal and .thousands"
        problems.append(Problem(where, f"not a finite number: {shown}", allowed, fix))
    return values


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


def _converted(cells: list[Any], decimal: str, thousands: str | None) -> np.ndarray:
    """Cells as floats (n,), NaN where one is none."""
    try:  # all at once
        text = "\n".join(cells) if thousands is None else "_"
        if "_" not in text and not (decimal == "," and "." in text):
            parts = text.replace("\u2212", "-").replace(decimal, ".").split("\n")
            if len(parts) == len(cells):
                return np.array([float(part) for part in parts])
    except (TypeError, ValueError):
        pass
    return np.array([_number(cell, decimal, thousands) for cell in cells], dtype=float)


def _number(cell: Any, decimal: str, thousands: str | None) -> float:
    try:
        if not isinstance(cell, str):
            return float(cell)
        cell = cell.strip().replace("\u2212", "-")
        if thousands is not None:
            cell = _BLANKS.sub(" ", cell) if thousands == " " else cell.replace("\u2019", "'")
            between = re.escape(thousands)
            whole = rf"[+-]?\d{{1,3}}(?:{between}\d{{3}})+(?:{re.escape(decimal)}\d*)?"
            if thousands in cell and not re.fullmatch(whole, cell):
                return np.nan
            cell = cell.replace(thousands, "")
        # A point would be a thousands mark beside decimal commas; Python takes 1_000.
        wrong = "_" in cell or (decimal != "." and "." in cell)
        return np.nan if wrong else float(cell.replace(decimal, "."))
    except (OverflowError, TypeError, ValueError):
        return np.nan
