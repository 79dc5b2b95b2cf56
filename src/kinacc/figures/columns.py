"""Reading columns of a table for drawing: missing columns named together, nulls as NaN."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.tables.columns import Columns


def require(table: Columns, names: Iterable[str], where: str) -> None:
    """Raise InputError naming every column of ``names`` that the table lacks."""
    lacking = [name for name in names if name not in table]
    if lacking:
        raise InputError(
            [
                Problem(where, f"column {name!r} is missing", f"columns {', '.join(names)}")
                for name in lacking
            ]
        )


def floats(table: Columns, name: str) -> np.ndarray:
    """Return a column as float64 with nulls as NaN."""
    values = np.asarray(table[name])
    if values.dtype == object:
        values = np.array([np.nan if v is None else v for v in values])
    return values.astype(np.float64)


def texts(table: Columns, name: str) -> np.ndarray:
    """Return a column as an object array of strings, nulls as the empty string."""
    return np.array(["" if v is None else str(v) for v in table[name]], dtype=object)


def rows(table: Columns, keep: np.ndarray) -> dict[str, np.ndarray]:
    """Return the rows where ``keep`` holds."""
    return {name: np.asarray(column)[keep] for name, column in table.items()}
