"""Rows of cells as a table: the line of names, what stands around the rows and is none of them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.layout import Layout
from kinacc.measurements.table import (
    ALLOWED,
    MOST_CELLS,
    MOST_COLUMNS,
    MOST_ROWS,
    SMALLER,
    RawTable,
    frame,
)
from kinacc.measurements.words import WORDS

Row = tuple[int, list]  # the line it ends on, its cells

_REMARK, _STATISTICS, _AGAIN, _TEXT = "remarks", "statistics of the rows", "the names again", "text"
_COMMENTS = ("#", "//", "%", "!", ";")
_LABELLED = frozenset(WORDS["statistics"])
_UNIT_BEHIND = re.compile(
    r"([+\-−]?[\d.,].*[\d.,]|[+\-−]?\d)\s*(°|deg|rad|gon|mm|m|cm|in|inch|µm|um)"
)
_LONGEST_NUMBER = 60  # with its unit
_FIRST_WORD = re.compile(r"[\s(\[:=/,]")
_RULE = re.compile(r"[\s\-=_+|*.;,\t]*")
_WITH_BRACKETS = re.compile(r"(?:\{[^{}]*\}|\[(?:[^\[\]]|\[[^\[\]]*\])*\]|\S)+")


class Words(list):
    """Cells of a line that are parted by blanks; ``line`` is what they were."""

    def __init__(self, line: str) -> None:
        within = "{" in line or "[" in line
        super().__init__(_WITH_BRACKETS.findall(line) if within else line.split())
        self.line = line.strip()


def number_of(cell: str) -> tuple[str, str]:
    """A cell such as 12.5° or 1204.3 mm as number and unit; the unit is empty where none is."""
    found = _UNIT_BEHIND.fullmatch(cell.strip()) if len(cell) < _LONGEST_NUMBER else None
    return (found[1], found[2]) if found else (cell, "")


def filled(cells: Sequence) -> list:
    """The cells that hold something."""
    return [c for c in cells if (c.strip() if isinstance(c, str) else c is not None)]


def is_comment(cells: Sequence, delimiter: str = "") -> bool:
    """Whether a row is a remark, or a rule of dashes, by what it begins with."""
    first = cells[0].lstrip() if cells and isinstance(cells[0], str) else ""
    if first.startswith(_COMMENTS) and not (delimiter == ";" and first.startswith(";")):
        return True
    if delimiter == ";" and not first and len(cells) > 1 and not filled(cells[2:]):
        return isinstance(cells[1], str) and not cells[1].strip().isdigit()  # "; Units: mm"
    return all(isinstance(cell, str) and _RULE.fullmatch(cell) for cell in cells) and any(
        len(cell.strip()) > 1 for cell in cells
    )


def _kind(cells: Sequence, delimiter: str) -> str:
    """What a row is that is no reading: a remark, or a mean or spread by its label."""
    first = cells[0]
    if first is not None and (type(first) is not str or first.lstrip("+-−")[:1].isdigit()):
        return ""
    if is_comment(cells, delimiter):
        return _REMARK
    label = str(filled(cells)[0]).strip(" \t:=").lower()
    known = label in _LABELLED or _FIRST_WORD.split(label, 1)[0] in _LABELLED
    return _STATISTICS if known and len(label) < 60 else ""


def header_cells(cells: list, width: int) -> list[str]:
    """The names of a line of names above rows of ``width`` cells.

    Where blanks part the cells, a name may hold one, or a unit in brackets behind one.
    """
    names = ["" if cell is None else str(cell).strip() for cell in cells]
    if not isinstance(cells, Words) or len(names) == width:
        return names
    joined: list[str] = []
    for word in names:
        if joined and word[:1] in "[(" and word[-1:] in "])":
            joined[-1] += f" {word}"
        else:
            joined.append(word)
    apart = re.split(r"\s{2,}|\t", cells.line)
    return next((each for each in (joined, apart) if len(each) == width), names)


def tabled(path: str, rows: Iterable[Row], layout: Layout, letters: Sequence[str] = ()) -> RawTable:
    """Rows of cells as a table. Raises InputError where names or rows are missing or ragged.

    ``letters`` of the columns where the rows are those of a sheet.
    """
    rows = [row for row in rows if row[0] > layout.skip_lines and filled(row[1])]
    line, head = (0, list(layout.names)) if layout.names is not None else (0, [])
    if not head and rows:
        line, head = rows.pop(0)
    kept, aside, under = _sorted(rows, layout, len(head))
    names = header_cells(head, max((len(cells) for _, cells in kept[:4]), default=0))
    names, kept, under = _named_blocks(names, kept, under)
    spare = {
        place
        for place, name in enumerate(names)
        if not name and not any(filled(cells[place : place + 1]) for _, cells in kept)
    }
    if spare:
        names, under, letters = (_without(spare, each) for each in (names, under, letters))
        kept = [(number, _without(spare, cells)) for number, cells in kept]
    width = len(names)
    kept = [(n, c if len(c) <= width or filled(c[width:]) else c[:width]) for n, c in kept]
    aside += [(n, c, _AGAIN) for n, c in kept if c[0] == names[0] and [*map(str, c)] == names]
    again = {number for number, _, why in aside if why == _AGAIN}
    kept = [row for row in kept if row[0] not in again]
    while len(kept) > 1 and (why := _closing(kept, width)):
        aside.append((*kept.pop(), why))
    refuse(_problems(path, names, kept, line, layout.delimiter, bool(letters)),
           f"{path} cannot be read")  # fmt: skip
    cells = frame(dict(zip(names, zip(*(c for _, c in kept), strict=True), strict=True)))
    units = {n: str(u) for n, u in zip(names, under, strict=False) if u is not None}
    table = RawTable(
        path,
        cells,
        np.array([number for number, _ in kept], dtype=np.int64),
        layout.decimal,
        layout.thousands,
        units | _units_behind(cells, units),
        not_rows=tuple(number for number, _, _ in aside),
        letters=dict(zip(names, letters, strict=False)),
    )
    return _noted(table, aside)


def _without(spare: set[int], cells: Sequence) -> list:
    return [cell for place, cell in enumerate(cells) if place not in spare]


def _sorted(rows: list[Row], layout: Layout, width: int):
    """Readings, rows that are none with what they are, and the last line under the names."""
    kept: list[Row] = []
    aside: list[tuple[int, list, str]] = []
    under: list = []
    left = layout.skip_under_names
    for line, cells in rows:
        why = _kind(cells, layout.delimiter)
        if why == _REMARK or (why and not left):
            aside.append((line, cells, why))
        elif left:
            under, left = cells, left - 1
        else:
            kept.append((line, cells))
    for why in (_REMARK, _STATISTICS):  # where most rows begin so, they are called so
        same = [row for row in aside if row[2] == why and len(row[1]) == width]
        if len(same) > len(kept):
            kept = sorted([*kept, *(row[:2] for row in same)], key=lambda row: row[0])
            aside = [row for row in aside if row[2] != why or len(row[1]) != width]
    return kept, aside, under


def _named_blocks(names: list[str], rows: list[Row], under: list):
    """Give rows of X, Y, Z the name that stands in a line of its own above them."""
    alone = [len(own) == 1 and isinstance(own[0], str) for own in (filled(c) for _, c in rows[:5])]
    if len(rows) < 4 or not alone[0] or all(alone):
        return names, rows, under
    last, found = "", []
    for line, cells in rows:
        own = filled(cells)
        if len(own) == 1 and isinstance(own[0], str):
            last = own[0].strip()
        elif not str(cells[0]).strip().upper().startswith(("X", "Y", "Z")):
            return names, rows, under
        else:
            found.append((line, [last, *cells]))
    return ["Feature", names[0] or "Axis", *names[1:]], found, ["", *under] if under else []


def _closing(rows: list[Row], width: int) -> str:
    """What a row under the last reading is, empty where it is a reading."""
    (before, others), (line, cells) = rows[-2:]
    own, other = str(cells[0]).strip(), str(others[0]).strip()
    if line - before > 1 and own and not re.search(r"\d", own) and re.search(r"\d", other):
        return _STATISTICS  # behind a blank line, and called by a word where others have numbers
    there = filled(cells)
    text = sum(isinstance(c, str) and c.strip()[:1] not in "+-.0123456789" for c in there)
    short = len(cells) < width if len(cells) != width else 2 * len(there) < width
    return _TEXT if short and there and 2 * text >= len(there) and len(there) < 4 else ""


def _units_behind(cells, units: dict[str, str]) -> dict[str, str]:
    """Take the unit off columns whose every number carries the same; the units by column."""
    found = {}
    for name in cells:
        column = cells[name]
        first = next((cell for cell in column if not RawTable.is_gap(cell)), None)
        unit = number_of(first)[1] if isinstance(first, str) else ""
        if not unit:
            continue
        parts = [(c, unit) if RawTable.is_gap(c) else number_of(str(c)) for c in column]
        if all(each[1] == unit for each in parts):
            cells[name] = [each[0] for each in parts]
            found |= {} if units.get(name, "").strip("-/ ") else {name: unit}
    return found


def _noted(table: RawTable, aside: list[tuple[int, list, str]]) -> RawTable:
    """The table with words on what was set aside, with its lines."""
    notes = []
    for why in (_REMARK, _STATISTICS, _AGAIN, _TEXT):
        which = [
            (line, str(filled(cells)[0]).strip()) for line, cells, kind in aside if kind == why
        ]
        if which:
            said = ", ".join(dict.fromkeys(label[:30] for _, label in which[:3]))
            what = "text under the rows" if why == _TEXT else why
            lines = table.row_names.few(sorted(line for line, _ in which))
            notes.append(f"{lines}: {what}, not read ({said})")
    return replace(table, notes=tuple(notes))


def _problems(
    path: str, names: list[str], rows: list[Row], line: int, delimiter: str, sheet: bool
) -> list[Problem]:
    if not names:
        return [Problem(path, "the file is empty", "a line of column names, then rows")]
    word, problems = ("row" if sheet else "line"), []
    if not rows:
        problems.append(Problem(path, "no rows under the column names", "at least one row"))
    where = f"{path}: {word} {line or 1}"
    if len(names) == 1:
        fix = "set measurements.file.delimiter to ';', ',' or a tab"
        problems.append(Problem(where, f"only one column, {names[0][:60]!r}", "several", fix))
    if doubled := sorted(name for name, count in Counter(names).items() if count > 1):
        problems.append(Problem(where, f"column names given twice: {', '.join(doubled)}"))
    ragged = [(number, len(cells)) for number, cells in rows if len(cells) != len(names)]
    if ragged and not problems:
        number, width = ragged[0]
        fix = "check the delimiter and the decimal mark: decimal commas between commas cannot be "
        fix += "told apart"
        what = f"{width} cells under {len(names)} column names"
        more = f" and {len(ragged) - 1} more" if len(ragged) > 1 else ""
        allowed = f"{len(names)} cells in every row"
        problems.append(Problem(f"{path}: {word} {number}{more}", what, allowed, fix))
    return problems


def refuse_too_much(path: str, rows: int, columns: int, cells: int) -> None:
    """Raise InputError where a file holds more than is read at once."""
    if rows > MOST_ROWS or columns > MOST_COLUMNS or cells > MOST_CELLS:
        raise InputError(Problem(path, f"{rows} rows of {columns} columns", ALLOWED, SMALLER))
