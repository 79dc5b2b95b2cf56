"""Rows of cells as a table: the line of names, and what stands around the rows."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from kinacc.errors import and_more, input_error
from kinacc.measurements.column_names import WORDS
from kinacc.measurements.layout import Layout
from kinacc.measurements.row_names import RowNames
from kinacc.measurements.table import RawTable, frame

Cells = Sequence[Any]
Row = tuple[int, list[Any]]  # the line it ends on, its cells

_COMMENTS = ("#", "//", "%", "!", ";")
_LABELLED = frozenset(WORDS["statistics"])
_UNIT_BEHIND = r"([+\-−]?[\d.,].*[\d.,]|[+\-−]?\d)\s*(°|deg|rad|gon|mm|m|cm|in|inch|µm|um)"
_FIRST_WORD = re.compile(r"[\s(\[:=/,]")
_RULE = re.compile(r"[\s\-=_+|*.;,\t]*")


def number_of(cell: str) -> tuple[str, str]:
    """A cell such as 12.5° or 1204.3 mm as number and unit; the unit is empty where none is."""
    match = re.fullmatch(_UNIT_BEHIND, cell.strip()) if len(cell) < 60 else None
    return (match[1], match[2]) if match else (cell, "")


def filled(cells: Cells) -> list[Any]:
    """The cells that hold something."""
    return [cell for cell in cells if not isinstance(cell, str) or cell.strip()]


def is_comment(cells: Cells) -> bool:
    """Whether a row is a remark, or a rule of dashes, by its beginning."""
    if cells and isinstance(cells[0], str) and cells[0].lstrip().startswith(_COMMENTS):
        return True
    return all(isinstance(cell, str) and _RULE.fullmatch(cell) for cell in cells) and any(
        len(cell.strip()) > 1 for cell in cells
    )


def _is_reading(cells: Cells) -> bool:
    """Whether a row is no remark, and no mean or spread by its label."""
    first = cells[0]
    if type(first) is not str or first.lstrip("+-−")[:1].isdigit():
        return True
    label = str(filled(cells)[0]).strip(" \t:=").lower()
    known = label in _LABELLED or _FIRST_WORD.split(label, maxsplit=1)[0] in _LABELLED
    return not is_comment(cells) and not (known and len(label) < 60)


def header_cells(cells: Cells, width: int) -> list[str]:
    """The names of a line of names above rows of ``width`` cells.

    Where blanks part the cells, units in brackets stand behind their name.
    """
    names = [str(cell).strip() for cell in cells]
    if len(names) == width:
        return names
    joined: list[str] = []
    for name in names:
        if joined and re.fullmatch(r"[\[(].*[\])]", name):
            joined[-1] += f" {name}"
        else:
            joined.append(name)
    return joined if len(joined) == width else names


def tabled(path: str, rows: Iterable[Row], layout: Layout, sheet: bool = False) -> RawTable:
    """Rows of cells as a table. Raises InputError where names or rows are missing or ragged.

    ``sheet``: the rows are those of a sheet.
    """
    rows = [(n, c) for n, c in rows if n > layout.skip_lines and (filled(c[:1]) or filled(c))]
    line, head = 0, list[Any](layout.names or ())
    if not head and rows:
        line, head = rows.pop(0)
    under = list[Any]()
    for _ in range(layout.skip_under_names):
        place = next((n for n, row in enumerate(rows) if not is_comment(row[1])), None)
        under = [] if place is None else rows.pop(place)[1]
    readings = [row for row in rows if _is_reading(row[1])]
    names = header_cells(head, max((len(cells) for _, cells in readings[:4]), default=0))
    width = len(names)
    readings = [(n, c if len(c) <= width or filled(c[width:]) else c[:width]) for n, c in readings]
    readings = [row for row in readings if row[1] != names]
    while len(readings) > 1 and _is_text(readings[-1][1], width):
        readings.pop()
    lines = dict(readings)
    aside = {number: cells for number, cells in rows if number not in lines}
    for place in reversed(range(width)):
        if not names[place] and not any(filled(row[place : place + 1]) for _, row in readings):
            for single in (names, under, *(cells for _, cells in readings)):
                del single[place : place + 1]
    word = "row" if sheet else "line"
    _refuse_no_table(path, names, readings, f"{path}: {word}", line or 1)
    cells = frame(dict(zip(names, zip(*(c for _, c in readings), strict=True), strict=True)))
    units = {name: str(unit) for name, unit in zip(names, under, strict=False)}
    row_names = RowNames(word=word)
    notes = [f"{row_names.spans(aside)}: not read ({str(filled(first)[0]).strip()[:30]})"
             for first in [*aside.values()][:1]]  # fmt: skip
    return RawTable(
        path,
        cells,
        np.array([*lines], dtype=np.int64),
        layout.decimal,
        layout.thousands,
        units | _units_behind(cells, units),
        tuple(notes),
        row_names,
    )


def _is_text(cells: Cells, width: int) -> bool:
    """Whether a row under the last reading is a text of few cells."""
    there = filled(cells)
    texts = sum(isinstance(c, str) and c.strip()[:1] not in "+-.0123456789" for c in there)
    short = len(cells) < width if len(cells) != width else 2 * len(there) < width
    return short and 0 < len(there) <= 2 * texts and len(there) < 4


def _units_behind(cells: pd.DataFrame, units: dict[str, str]) -> dict[str, str]:
    """Take the unit off columns whose every number carries the same; the units by column."""
    behind: dict[str, str] = {}
    for name in cells:
        column = cells[name]
        first = next((cell for cell in column if not RawTable.is_gap(cell)), None)
        unit = number_of(first)[1] if isinstance(first, str) else ""
        if not unit:
            continue
        parts = [(c, unit) if RawTable.is_gap(c) else number_of(str(c)) for c in column]
        if all(part[1] == unit for part in parts):
            cells[name] = [part[0] for part in parts]
            behind |= {} if units.get(name, "").strip("-/ ") else {name: unit}
    return behind


def _refuse_no_table(path: str, names: list[str], rows: list[Row], where: str, line: int) -> None:
    """Raise InputError for names or rows that are missing, doubled names and ragged rows."""
    if not names:
        raise input_error(path, "the file is empty", "a line of column names, then rows")
    if not rows:
        raise input_error(path, "no rows under the column names", "a row at least")
    if len(names) == 1:
        fix = "set measurements.file.delimiter to ';', ',' or a tab"
        raise input_error(f"{where} {line}", f"only one column, {names[0][:60]!r}", "several", fix)
    if doubled := sorted(name for name, count in Counter(names).items() if count > 1):
        raise input_error(f"{where} {line}", f"column names given twice: {', '.join(doubled)}")
    ragged = [(number, len(cells)) for number, cells in rows if len(cells) != len(names)]
    for number, width in ragged[:1]:
        message = f"{width} cells under {len(names)} column names"
        fix = "check delimiter and decimal mark: decimal commas cannot stand between commas"
        place = f"{where} {number}{and_more(len(ragged) - 1)}"
        raise input_error(place, message, f"{len(names)} cells in every row", fix)
