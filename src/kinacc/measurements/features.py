"""Reports with a row per feature and axis, turned into a row per feature.

Columns Nominal, Measured, Dev under a column of axes become Nominal X, Nominal Y and the like.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.measurements.column_names import DEVIATION, MEASURED, NOMINAL, REPORTED, name_of, role
from kinacc.measurements.table import RawTable

AXES = "XYZ"
_BESIDE_TEXT = "axis achse axe eje asse wert value coord coordinate koordinate pos position point"
_BESIDE = frozenset((*_BESIDE_TEXT.split(), "center", "centre"))
_VALUES = (NOMINAL, MEASURED, REPORTED, DEVIATION)


@dataclass(frozen=True)
class Report:
    """Columns of such a report: of feature names, of axes, and of ``values`` of each axis."""

    feature: str
    axis: str
    values: tuple[str, ...]


def axis_of(cell: object) -> str:
    """X, Y or Z, empty where a cell is none of them."""
    if not isinstance(cell, str) or len(cell) > 40:
        return ""
    if len(cell.strip()) == 1:
        return cell.strip().upper() if cell.strip().upper() in AXES else ""
    words = set(name_of(cell).words) - _BESIDE
    return next(iter(words)).upper() if len(words) == 1 and words <= set("xyz") else ""


def report_of(table: RawTable) -> Report | None:
    """The columns of a report of features and axes; None where the table is no such report."""
    axes = ""
    for name, cells in table.columns.items():
        kinds = dict.fromkeys(cells)
        if len(kinds) < 60 and {axis_of(each) for each in kinds} >= set(AXES):
            axes = name
            break
    if not axes:
        return None
    roles = {name: role(name_of(name).words) for name in table.columns}
    values = [name for name, said in roles.items() if said in _VALUES and name != axes]
    values = [name for name in values if _mostly_numbers(table.columns[name])]
    measured = [name for name in values if roles[name] in (MEASURED, REPORTED)]
    if not measured:
        return None
    names = [
        name
        for name, cells in table.columns.items()
        if name not in (axes, *values) and not table.is_gap(cells[0]) and _repeated(table, cells)
    ]
    return Report(names[0], axes, tuple(values)) if names else None


def _mostly_numbers(cells: Sequence) -> bool:
    filled = [each for each in cells if not RawTable.is_gap(each)]
    good = [not isinstance(e, str) or e.strip()[:1] in (*"+-.−0123456789",) for e in filled]
    return bool(filled) and 2 * sum(good) > len(filled)


def _repeated(table: RawTable, cells: Sequence) -> bool:
    """Whether cells can name features: each stands for several rows."""
    filled = [each for each in cells if not table.is_gap(each)]
    return 2 * len(set(filled)) <= len(cells) + 1 or len(filled) * 2 <= len(cells) + 1


def by_feature(table: RawTable) -> RawTable:
    """A row per feature. Raises InputError where the table is no report of features and axes.

    A row stands on the first line of its feature; a feature that comes again is a row again.
    """
    found = report_of(table)
    if found is None:
        what = "is no report with a row per feature and axis"
        allowed = "a column of names, one of X, Y, Z, and columns such as Nominal, Measured, Dev"
        raise InputError(Problem(table.path, what, allowed, "set measurements.file.layout: table"))
    rows, other = _rows(table, found)
    first = [min(each.values()) for each in rows]
    others = [name for name in table.columns if name not in (found.axis, *found.values)]
    others.remove(found.feature)
    differ = [name for name in others if _differs(table, name, rows)]
    names = _filled(table, found.feature)
    columns: dict[str, list] = {found.feature: [names[row] for row in first]}
    for value in found.values:
        cells = table.columns[value]
        for axis in AXES:
            columns[f"{value} {axis}"] = [
                cells[each[axis]] if axis in each else None for each in rows
            ]
    for name in others:
        if name not in differ:
            cells = table.columns[name]
            columns[name] = [_first(table, [cells[r] for r in each.values()]) for each in rows]
    notes = list(table.notes)
    if other:
        kinds = list(dict.fromkeys(str(table.columns[found.axis][row]) for row in other))
        told = ", ".join(kinds[:5])
        notes.append(f"{len(other)} rows of other quantities than X, Y, Z, not read ({told})")
    if differ:
        notes.append(f"columns that differ between the axes, not read: {', '.join(differ)}")
    letters = {} if not table.letters else dict.fromkeys(columns, "") | dict(table.letters)
    under = dict(zip(table.columns, table.under, strict=False))
    units = tuple(under.get(name, under.get(name[:-2], "")) for name in columns)
    return replace(
        table,
        columns=columns,
        line=table.line[np.array(first, dtype=int)],
        under=units if table.under else (),
        notes=tuple(notes),
        letters=letters,
    )


def _filled(table: RawTable, name: str) -> list:
    """Cells of a column in which a name stands for the rows below it too."""
    told, last = [], None
    for cell in table.columns[name]:
        last = last if table.is_gap(cell) else cell
        told.append(last)
    return told


def _rows(table: RawTable, found: Report) -> tuple[list[dict[str, int]], list[int]]:
    """Rows of the table by axis, for every feature; and those of none of the axes."""
    known = {cell: axis_of(cell) for cell in dict.fromkeys(table.columns[found.axis])}
    rows: list[dict[str, int]] = []
    other, last = [], object()
    pairs = zip(_filled(table, found.feature), table.columns[found.axis], strict=True)
    for row, (name, cell) in enumerate(pairs):
        axis = known[cell]
        if not axis:
            other.append(row)
            continue
        if name != last or axis in rows[-1]:
            rows.append({})
            last = name
        rows[-1][axis] = row
    return rows, other


def _first(table: RawTable, cells: Sequence) -> object:
    return next((each for each in cells if not table.is_gap(each)), None)


def _differs(table: RawTable, name: str, rows: Sequence[dict[str, int]]) -> bool:
    """Whether the rows of some feature do not agree on a column."""
    cells = table.columns[name]
    return any(
        len({cells[r] for r in each.values() if not table.is_gap(cells[r])}) > 1 for each in rows
    )
