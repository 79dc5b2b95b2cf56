"""A DataFrame on the screen."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pandas as pd
from rich.table import Table

from kinacc.errors import as_seen


def as_rich(table: pd.DataFrame, headings: Mapping[str, str]) -> Table:
    """Return the columns of ``headings`` as a rich table, numbers with three digits."""
    shown = Table(box=None, pad_edge=False)
    for name, heading in headings.items():
        numeric = pd.api.types.is_numeric_dtype(table[name])
        shown.add_column(heading, justify="right" if numeric else "left", overflow="fold")
    for _, row in table.iterrows():
        shown.add_row(*(_cell(row[name]) for name in headings))
    return shown


def _cell(value: object) -> str:
    if not isinstance(value, float):
        return "-" if value is None else as_seen(str(value))
    if not math.isfinite(value):
        return "-"
    if value == 0.0 or value.is_integer():
        return f"{value:.0f}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"
