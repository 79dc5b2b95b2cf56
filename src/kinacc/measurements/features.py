"""Reports with a row per feature and axis, turned into a row per feature.

Columns Nominal, Measured, Dev under a column of axes become Nominal X, Nominal Y and the like.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.measurements.column_names import (
    DEVIATION,
    MEASURED,
    NOMINAL,
    REPORTED,
    WORDS,
    name_of,
    role,
)
from kinacc.measurements.table import RawTable, frame

AXES = "XYZ"


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
    words = {*name_of(cell).terms} - WORDS["axis"] or {cell.strip().lower()}
    return words.pop().upper() if len(words) == 1 and words <= {*"xyz"} else ""


def report_of(table: RawTable) -> Report | None:
    """The columns of a report of features and axes; None where the table is no such report."""

    def has_axes(cells: Sequence) -> bool:
        kinds = dict.fromkeys(cells)
        return len(kinds) < 60 and {axis_of(each) for each in kinds} >= {*AXES}

    axis = next((name for name in table.columns if has_axes(table.columns[name])), None)
    if axis is None:
        return None
    filled = {n: [c for c in table.columns[n] if not table.is_gap(c)] for n in table.columns}
    roles = {name: role(name_of(name).terms) for name in filled if name != axis}
    values = [
        name
        for name, said in roles.items()
        if said in (NOMINAL, MEASURED, REPORTED, DEVIATION) and _mostly_numbers(filled[name])
    ]
    # A name stands for several rows: in each of them, or in the first.
    names = [
        name
        for name in roles
        if name not in values
        and not table.is_gap(table.columns[name][0])
        and 2 * min(len({*filled[name]}), len(filled[name])) <= len(table) + 1
    ]
    measured = any(roles[name] in (MEASURED, REPORTED) for name in values)
    return Report(names[0], axis, tuple(values)) if names and measured else None


def _mostly_numbers(cells: Sequence) -> bool:
    good = [not isinstance(e, str) or e.strip()[:1] in {*"+-.−0123456789"} for e in cells]
    return bool(cells) and 2 * sum(good) > len(good)


def by_feature(table: RawTable) -> RawTable:
    """A row per feature. Raises InputError where the table is no report of features and axes.

    A row stands on the first line of its feature; a feature that comes again is a row again.
    """
    found = report_of(table)
    if found is None:
        what = "is no report with a row per feature and axis"
        allowed = "a column of names, one of X, Y, Z, and columns such as Nominal, Measured, Dev"
        raise InputError(Problem(table.path, what, allowed, "set measurements.file.layout: table"))
    names = table.columns[found.feature].mask(table.gaps(found.feature)).ffill().tolist()
    axes = [axis_of(cell) for cell in table.columns[found.axis]]
    rows: list[dict[str, int]] = []
    last: object = None
    for row, (name, axis) in enumerate(zip(names, axes, strict=True)):
        if axis:
            if not rows or name != last or axis in rows[-1]:
                rows.append({})
                last = name
            rows[-1][axis] = row
    first = np.array([min(each.values()) for each in rows])
    columns: dict[str, Sequence] = {found.feature: [names[row] for row in first]}
    units = dict(table.units)
    for value in found.values:
        cells = table.columns[value]
        for axis in AXES:
            columns[f"{value} {axis}"] = [cells.get(each.get(axis, -1)) for each in rows]
            units[f"{value} {axis}"] = units.get(value, "")
    for name in table.columns:
        if name not in (found.feature, found.axis, *found.values):
            cells, gaps = table.columns[name], table.gaps(name)
            own = [dict.fromkeys(cells[r] for r in each.values() if not gaps[r]) for each in rows]
            if all(len(each) < 2 for each in own):  # of the feature, and not of an axis
                columns[name] = [next(iter(each), None) for each in own]
    notes = list(table.notes)
    if other := [str(table.columns[found.axis][n]) for n, axis in enumerate(axes) if not axis]:
        told = ", ".join([*dict.fromkeys(other)][:5])
        notes.append(f"{len(other)} rows of other quantities than X, Y, Z, not read ({told})")
    made = replace(table, columns=frame(columns), line=table.line[first], units=units)
    return replace(made, notes=tuple(notes))
