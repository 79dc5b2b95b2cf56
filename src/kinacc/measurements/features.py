"""Reports with a row per feature and axis, turned into a row per feature.

Columns Nominal, Measured, Dev under a column of axes become Nominal X, Nominal Y and the like.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd

from kinacc.errors import input_error
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


def axis_of(cell: object) -> str:
    """X, Y or Z, empty where a cell is none of them."""
    if not isinstance(cell, str) or len(cell) > 40:
        return ""
    if cell.isascii() and not {*cell.lower()} & {*"xyz"}:
        return ""  # a number, most of the time
    terms = {*name_of(cell).terms} - WORDS["axis"] or {cell.strip().lower()}
    return terms.pop().upper() if len(terms) == 1 and terms <= {*"xyz"} else ""


def report_of(table: RawTable) -> tuple[str, str, list[str]] | None:
    """Columns of a report: of feature names, of axes, and of values of each axis; None for none."""
    kinds = {name: dict.fromkeys(table.columns[name]) for name in table.columns}
    axes = [name for name, cells in kinds.items()
            if len(cells) < 60 and {*map(axis_of, cells)} >= {*AXES}]  # fmt: skip
    if not axes:
        return None
    cells = table.columns.drop(columns=axes[0]).mask(table.columns.map(table.is_gap))
    roles = {name: role(name_of(name).terms) for name in cells}
    values = [name for name in cells if roles[name] in (NOMINAL, MEASURED, REPORTED, DEVIATION)
              and 2 * np.isfinite(table.values(name)).sum() > len(table)]  # fmt: skip
    # A name stands for several rows: in each of them, or in the first.
    names = [name for name in cells if name not in values and pd.notna(cells[name][0])
             and 2 * cells[name].nunique() <= len(table) + 1]  # fmt: skip
    measured = any(roles[name] in (MEASURED, REPORTED) for name in values)
    return (names[0], axes[0], values) if names and measured else None


def by_feature(table: RawTable) -> RawTable:
    """A row per feature. Raises InputError where the table is no report of features and axes.

    A row stands on the first line of its feature; a feature that comes again is a row again.
    """
    report = report_of(table)
    if report is None:
        message = "is no report with a row per feature and axis"
        allowed = "a column of names, one of X, Y, Z, and columns such as Nominal, Measured, Dev"
        fix = "set measurements.file.layout: table"
        raise input_error(table.path, message, allowed, fix)
    feature, axis_column, values = report
    cells = table.columns.mask(table.columns.map(table.is_gap), None)
    cells[feature] = cells[feature].ffill()
    axes = table.columns[axis_column].map(axis_of)
    rows = cells[axes != ""]
    axes = axes[rows.index]
    # In the order of AXES, whose letters are in order.
    begins = (rows[feature] != rows[feature].shift()) | (axes <= axes.shift(fill_value=""))
    group = begins.to_numpy().cumsum() - 1
    of_axes = rows[values].groupby([group, axes.to_numpy()]).first().unstack()
    columns, units = {feature: rows[feature][begins]}, dict(table.units)
    for value, axis in product(values, AXES):
        columns[f"{value} {axis}"] = of_axes[value, axis]
        units[f"{value} {axis}"] = units.get(value, "")
    for name in cells.columns.difference([feature, axis_column, *values], sort=False):
        of_feature = rows[name].groupby(group)
        if (of_feature.nunique() < 2).all():  # and not of an axis
            columns[name] = of_feature.first()
    notes, others = table.notes, len(table) - len(rows)
    if others:
        notes += (f"{others} rows of other quantities than X, Y, Z, not read",)
    line = table.line[rows.index[begins]]
    return replace(table, columns=frame(columns), line=line, units=units, notes=notes)
